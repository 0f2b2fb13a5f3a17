/** The viewer's camera: held always, or preferred while it sees the person. */

/** @import {AddressView} from '../shared/address.js' */

export class ViewPreference {
  /** @type {string | null} */
  #camera = null;
  /** @type {string[]} */
  #cameras = [];
  prefers = false;

  /** @param {Pick<AddressView, 'camera' | 'prefer'>} view */
  constructor(view) {
    this.set(view);
  }

  /**
   * @param {Pick<AddressView, 'camera' | 'prefer'>} view
   * @returns {boolean} whether it changed
   */
  set({ camera, prefer }) {
    const [old, preferred] = [this.#camera, this.prefers];
    this.#camera = camera ?? prefer;
    this.prefers = camera === null && prefer !== null;
    return old !== this.#camera || preferred !== this.prefers;
  }

  /** @param {string[]} cameras of the site: others are ignored */
  configure(cameras) {
    this.#cameras = cameras;
  }

  /** @param {string | null} camera to hold; the held one, or null: return to the best view */
  hold(camera) {
    this.set({ camera: camera === this.#camera ? null : camera, prefer: null });
  }

  /** Change from holding to preferring, or back. */
  togglePrefer() {
    if (this.#camera !== null) this.prefers = !this.prefers;
  }

  /** @returns {string | null} the held or preferred camera */
  get camera() {
    return this.#camera !== null && this.#cameras.includes(this.#camera) ? this.#camera : null;
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
   * @param {string | null} best camera of the best view
   * @param {string | null} displayed
   * @param {boolean} live cameras are preferred only live
   * @returns {string | null} why this camera is displayed; null: not because of the preference
   */
  reason(best, displayed, live) {
    const { camera } = this;
    if (camera === null || (this.prefers && !live)) return null;
    if (this.prefers && displayed !== camera) return `${camera} is preferred, but does not see this person now.`;
    const comparison = best === camera ? 'It is the best view now.' : `The best view now is ${best}.`;
    return [this.prefers ? 'Preferred.' : 'Held.', ...(best === null ? [] : [comparison])].join(' ');
  }

  /** @returns {Pick<AddressView, 'camera' | 'prefer'>} for the address, including a camera that the site lacks */
  get addressPart() {
    return { camera: this.prefers ? null : this.#camera, prefer: this.prefers ? this.#camera : null };
  }
}
