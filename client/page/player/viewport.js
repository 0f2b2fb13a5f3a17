/** Which part of the frame now shown is to fill the picture, where the person is followed. */

import { Follow } from './viewport_follow.js';

/** @import {Box} from '../shared/contract.js' */
/** @import {Part, Size} from './viewport_follow.js' */

export class Framing {
  on = false;
  #follow = new Follow();
  #whom = '';

  /**
   * @param {string} whom in which camera: where that changes, there is nothing to move from
   * @param {Box | undefined} box theirs
   * @param {Size} picture
   * @param {number} passed seconds since the frame before
   * @returns {Part | null} null: all of it
   */
  step(whom, box, picture, passed) {
    if (whom !== this.#whom || !this.on) this.#follow.reset();
    this.#whom = whom;
    return this.on ? this.#follow.step(box, picture, passed) : null;
  }
}
