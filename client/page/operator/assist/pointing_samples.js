/** Where the operator corrections, frame by frame: kept until it is sent, and sent by camera. No element. */

/**
 * @typedef {object} Point
 * @property {number} pulse
 * @property {number} x pixels of the site's picture
 * @property {number} y
 * @property {number} tolerance how far off it may be
 *
 * @typedef {object} Said
 * @property {number} object
 * @property {string} camera
 * @property {Point[]} corrections
 */

const KEPT = 250; // of what could not be sent, the newest: a server that was away is not overrun

export class Samples {
  /** @type {(Said & {corrections: [Point]})[]} one for each frame, in order */
  #waiting = [];

  /**
   * A frame that is pointed at again is where it was pointed at last.
   *
   * @param {number} object
   * @param {string} camera
   * @param {Point} point
   */
  add(object, camera, point) {
    const last = this.#waiting.at(-1);
    const same = last?.corrections[0].pulse === point.pulse && last.camera === camera && last.object === object;
    if (same) this.#waiting.pop();
    this.#waiting.push({ object, camera, corrections: [point] });
    if (this.#waiting.length > KEPT) this.#waiting.shift();
  }

  /** @returns {Said | null} the first of what waits that can be sent at once; null: nothing waits */
  take() {
    const [first] = this.#waiting;
    if (!first) return null;
    const { object, camera } = first;
    const end = this.#waiting.findIndex((it) => it.object !== object || it.camera !== camera);
    const taken = this.#waiting.splice(0, end < 0 ? this.#waiting.length : end);
    return { object, camera, corrections: taken.map(({ corrections: [point] }) => point) };
  }
}
