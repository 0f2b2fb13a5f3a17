/** Why this view: the server's one plain sentence about the present choice, or about that of a moment of the past. */

import { getJson } from '../shared/requests.js';

/** @import {Choice} from '../shared/contract.js' */

const EVERY_MS = 3000;

export class Reason {
  #asked = -Infinity;
  #about = '';

  /** @param {HTMLElement} place */
  constructor(place) {
    this.place = place;
  }

  /**
   * Ask, unless this was asked just now. Called often.
   *
   * @param {number} object
   * @param {string | null} camera now shown
   * @param {number | null} pulse now shown, of the past; null: it is live
   */
  async about(object, camera, pulse) {
    const about = `${object} ${camera} ${pulse === null}`;
    const now = performance.now();
    if (about === this.#about && now - this.#asked < EVERY_MS) return;
    this.#about = about;
    this.#asked = now;
    const query = pulse === null ? '' : `?at=p${pulse}`;
    try {
      const choice = /** @type {Choice} */ (await getJson(`api/objects/${object}/choice${query}`));
      // The choice runs ahead of the picture by the look-ahead: it may already be about the next view.
      this.#say(about, choice.camera === camera ? choice.reason : '');
    } catch {
      this.#say(about, '');
    }
  }

  /** @param {string} text instead */
  put(text) {
    this.#about = '';
    this.#asked = -Infinity;
    this.place.textContent = this.place.title = text;
  }

  /**
   * @param {string} about an answer to an older question is not said any more
   * @param {string} text
   */
  #say(about, text) {
    if (about === this.#about) this.place.textContent = this.place.title = text;
  }
}
