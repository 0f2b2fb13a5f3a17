/** Where in the past somebody watches, if it is not what happens now. */

/**
 * @typedef {object} Moment
 * @property {number} pulse
 * @property {number} time of that pulse: media time, seconds
 */

export class Past {
  /** @type {Moment | null} where what is watched began; null: it is live */
  moment = null;
  /** Whether it is watched because the picture was paused, and not because somebody wished to look back. */
  resumed = false;

  /**
   * @param {number} pulse
   * @param {number} fps
   * @param {boolean} resumed
   */
  begin(pulse, fps, resumed) {
    this.moment = { pulse, time: pulse / fps };
    this.resumed = resumed;
  }

  /** Whoever is watched next, or by which camera, is watched from the moment that is now shown. */
  moveOn(/** @type {number} */ pulse, /** @type {number} */ fps) {
    if (this.moment) this.begin(pulse, fps, this.resumed);
  }

  /** What happens now. */
  leave() {
    this.moment = null;
  }
}
