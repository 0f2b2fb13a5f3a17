/** Why this view: one sentence from the server about the selection displayed now. */

import { getJson } from '../shared/requests.js';

/** @import {Choice} from '../shared/api_types.js' */

const INTERVAL_MS = 3000;

export class SelectionReason {
  #requestedAt = -Infinity;
  #key = '';

  /** @param {HTMLElement} target */
  constructor(target) {
    this.target = target;
  }

  /**
   * Request and show the reason, unless it was requested within the interval. Called often.
   *
   * @param {number} object
   * @param {string | null} camera displayed
   * @param {number | null} pulse displayed, of the past; null: live
   */
  async refresh(object, camera, pulse) {
    const key = `${object} ${camera} ${pulse === null}`;
    const now = performance.now();
    if (key === this.#key && now - this.#requestedAt < INTERVAL_MS) return;
    this.#key = key;
    this.#requestedAt = now;
    const query = pulse === null ? '' : `?at=p${pulse}`;
    try {
      const choice = /** @type {Choice} */ (await getJson(`api/objects/${object}/choice${query}`));
      // Decisions are ahead of the video by the look-ahead: this one may be about the next view.
      this.#show(key, choice.camera === camera ? choice.reason : '');
    } catch {
      this.#show(key, '');
    }
  }

  /** @param {string} text shown instead of a reason */
  replace(text) {
    this.#key = '';
    this.#requestedAt = -Infinity;
    this.target.textContent = this.target.title = text;
  }

  /**
   * @param {string} key of the request; an outdated answer is not shown
   * @param {string} text
   */
  #show(key, text) {
    if (key === this.#key) this.target.textContent = this.target.title = text;
  }
}
