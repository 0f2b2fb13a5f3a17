/** By which camera somebody wishes to see: held, whichever is best; or preferred, while it sees the person. */

/** @import {Watched} from '../shared/address.js' */

export class Override {
  /** @type {string | null} */
  #camera = null;
  /** @type {string[]} */
  #known = [];
  prefers = false;

  /** @param {Watched} watched */
  constructor(watched) {
    this.take(watched);
  }

  /**
   * @param {Pick<Watched, 'camera' | 'prefer'>} watched
   * @returns {boolean} whether that is something else
   */
  take({ camera, prefer }) {
    const [old, preferred] = [this.#camera, this.prefers];
    this.#camera = camera ?? prefer;
    this.prefers = camera === null && prefer !== null;
    return old !== this.#camera || preferred !== this.prefers;
  }

  /** @param {string[]} cameras of the site: what is not among them is not wished for */
  configure(cameras) {
    this.#known = cameras;
  }

  /** @param {string | null} camera to hold; once more, or null: the best is shown again */
  hold(camera) {
    const mine = camera === this.#camera;
    this.take({ camera: mine ? null : camera, prefer: null });
  }

  /** Hold no longer, but prefer; or the other way. */
  toggle() {
    if (this.#camera !== null) this.prefers = !this.prefers;
  }

  /** @returns {string | null} the camera that is wished for in either way */
  get camera() {
    return this.#camera !== null && this.#known.includes(this.#camera) ? this.#camera : null;
  }

  /** @returns {string | null} */
  get held() {
    return this.prefers ? null : this.camera;
  }

  /** @returns {string | null} */
  get preferred() {
    return this.prefers ? this.camera : null;
  }

  /**
   * @param {string | null} best the camera that would be shown
   * @param {string | null} shown
   * @param {boolean} live only then a camera is preferred
   * @returns {string | null} why this camera is shown; null: not by what somebody wishes
   */
  words(best, shown, live) {
    const { camera } = this;
    if (camera === null || (this.prefers && !live)) return null;
    if (this.prefers && shown !== camera) return `${camera} is preferred, and does not see this person just now.`;
    const better = best === camera ? 'It is the best view now.' : `The best view now is ${best}.`;
    return [this.prefers ? 'Preferred.' : 'Held by hand.', ...(best === null ? [] : [better])].join(' ');
  }

  /** @returns {Pick<Watched, 'camera' | 'prefer'>} for the address: also of a camera that is not known */
  get written() {
    return { camera: this.prefers ? null : this.#camera, prefer: this.prefers ? this.#camera : null };
  }
}
