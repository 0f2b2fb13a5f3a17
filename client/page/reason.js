/** Why this view: the server's one plain sentence about the present choice. */

import { getJson } from './http.js';

/** @import {Choice} from './contract.js' */

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
   */
  async about(object, camera) {
    const about = `${object} ${camera}`;
    const now = performance.now();
    if (about === this.#about && now - this.#asked < EVERY_MS) return;
    this.#about = about;
    this.#asked = now;
    try {
      const choice = /** @type {Choice} */ (await getJson(`api/objects/${object}/choice`));
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
