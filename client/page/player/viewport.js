/**
 * The viewport that frames the selected person: a part of the picture with the picture's aspect ratio.
 *
 * It moves exponentially towards the person, and zooms more slowly than it pans.
 */

/** @import {Box} from '../shared/api_types.js' */

const FILL = 0.6; // share of the viewport's height that the person takes
const MAX_ZOOM = 3; // beyond it only pixels are to be seen
const PAN_S = 0.35; // time constant of the center
const ZOOM_S = 0.9; // time constant of the size
const HOLD_S = 1; // how long the viewport stays without a detection, before it opens to the whole picture

/**
 * @typedef {object} Viewport part of a picture, in its pixels
 * @property {number} left
 * @property {number} top
 * @property {number} width
 * @property {number} height
 *
 * @typedef {{width: number, height: number}} Size
 */

/** Moves a viewport with a person. Pure arithmetic: no DOM. */
export class ViewportFollower {
  /** @type {{x: number, y: number, height: number} | null} center and height of the viewport */
  #state = null;
  #missing = 0; // seconds since the person was last detected

  /** Jump to the target in the next step: another camera or another person. */
  reset() {
    this.#state = null;
    this.#missing = 0;
  }

  /**
   * @param {Box | undefined} box of the person in the displayed frame
   * @param {Size} picture
   * @param {number} seconds since the frame before; NaN and negative values count as 0
   * @returns {Viewport}
   */
  step(box, picture, seconds) {
    const time = seconds > 0 ? seconds : 0;
    this.#missing = box ? 0 : this.#missing + time;
    const target = box ? around(box, picture) : this.#missing > HOLD_S || !this.#state ? whole(picture) : this.#state;
    const state = this.#state ?? target;
    const [pan, zoom] = [1 - Math.exp(-time / PAN_S), 1 - Math.exp(-time / ZOOM_S)];
    this.#state = {
      x: state.x + pan * (target.x - state.x),
      y: state.y + pan * (target.y - state.y),
      height: state.height + zoom * (target.height - state.height),
    };
    return inside(this.#state, picture);
  }
}

/** The Follow button: a viewport while it is on. */
export class PersonViewport {
  on = false;
  #follower = new ViewportFollower();
  #key = '';

  /**
   * @param {string} key person and camera; the viewport jumps when it changes
   * @param {Box | undefined} box of the person
   * @param {Size} picture
   * @param {number} seconds since the frame before
   * @returns {Viewport | null} null: the whole picture
   */
  step(key, box, picture, seconds) {
    if (key !== this.#key || !this.on) this.#follower.reset();
    this.#key = key;
    return this.on ? this.#follower.step(box, picture, seconds) : null;
  }
}

/**
 * @param {Box} box
 * @param {Size} picture
 */
function around([, left, top, right, bottom], picture) {
  const height = Math.min(Math.max((bottom - top) / FILL, picture.height / MAX_ZOOM), picture.height);
  return { x: (left + right) / 2, y: (top + bottom) / 2, height };
}

/** @param {Size} picture */
function whole({ width, height }) {
  return { x: width / 2, y: height / 2, height };
}

/**
 * @param {{x: number, y: number, height: number}} state
 * @param {Size} picture
 * @returns {Viewport} moved inside the picture
 */
function inside({ x, y, height }, picture) {
  const width = (height * picture.width) / picture.height;
  const left = Math.min(Math.max(x - width / 2, 0), picture.width - width);
  const top = Math.min(Math.max(y - height / 2, 0), picture.height - height);
  return { left, top, width, height };
}
