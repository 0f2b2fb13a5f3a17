/**
 * Which part of the picture to show so that the chosen person is framed: pure arithmetic, no element.
 *
 * The part has the picture's own shape and lies inside it. It moves as a calm hand would move a camera:
 * towards where the person is, the faster the further off, and nearer or further more slowly than sideways.
 */

/** @import {Box} from '../shared/contract.js' */

const FILLED = 0.6; // of the height that is shown is the person's
const NEAREST = 3; // times as large as the whole picture, at most: beyond, pixels are all there is to see
const ASIDE_S = 0.35; // time constant, of the middle
const NEARER_S = 0.9; // the same of the size
const HELD_S = 1; // for which the part stays when the person is not found; then it opens

/**
 * @typedef {object} Part of a picture, in its pixels
 * @property {number} left
 * @property {number} top
 * @property {number} width
 * @property {number} height
 *
 * @typedef {{width: number, height: number}} Size
 */

export class Follow {
  /** @type {{x: number, y: number, height: number} | null} middle and height of the part */
  #at = null;
  #missing = 0; // seconds since the person was found last

  /** The next part is where it should be at once: another camera, another person. */
  reset() {
    this.#at = null;
    this.#missing = 0;
  }

  /**
   * @param {Box | undefined} box of the person in the frame now shown
   * @param {Size} picture
   * @param {number} seconds since the frame before; what is no time step is none
   * @returns {Part}
   */
  step(box, picture, seconds) {
    const time = seconds > 0 ? seconds : 0;
    this.#missing = box ? 0 : this.#missing + time;
    const aim = box ? around(box, picture) : this.#missing > HELD_S || !this.#at ? whole(picture) : this.#at;
    const at = this.#at ?? aim;
    const [aside, nearer] = [1 - Math.exp(-time / ASIDE_S), 1 - Math.exp(-time / NEARER_S)];
    this.#at = {
      x: at.x + aside * (aim.x - at.x),
      y: at.y + aside * (aim.y - at.y),
      height: at.height + nearer * (aim.height - at.height),
    };
    return inside(this.#at, picture);
  }
}

/**
 * @param {Box} box
 * @param {Size} picture
 */
function around([, left, top, right, bottom], picture) {
  const height = Math.min(Math.max((bottom - top) / FILLED, picture.height / NEAREST), picture.height);
  return { x: (left + right) / 2, y: (top + bottom) / 2, height };
}

/** @param {Size} picture */
function whole({ width, height }) {
  return { x: width / 2, y: height / 2, height };
}

/**
 * @param {{x: number, y: number, height: number}} at
 * @param {Size} picture
 * @returns {Part}
 */
function inside({ x, y, height }, picture) {
  const width = (height * picture.width) / picture.height;
  const left = Math.min(Math.max(x - width / 2, 0), picture.width - width);
  const top = Math.min(Math.max(y - height / 2, 0), picture.height - height);
  return { left, top, width, height };
}
