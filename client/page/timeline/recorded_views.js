/** How far back the selected person was recorded, and by which cameras they were shown: requested at intervals. */

import { getJson } from '../shared/requests.js';

/**
 * @typedef {object} View frames [first, end) of one camera
 * @property {string} camera
 * @property {number} first
 * @property {number} end
 */

const INTERVAL_MS = 30_000;
const FULL_INTERVAL_MS = 600_000; // in between only new views are requested: a week of them is large

export class RecordedViews {
  /** @type {View[]} in order */
  views = [];
  #requestedAt = -Infinity;
  #fullRequestAt = -Infinity;
  /** @type {number | null} */
  #object = null;

  /** @returns {number} the first recorded pulse; Infinity: none, or unknown */
  get first() {
    return this.views[0]?.first ?? Infinity;
  }

  /**
   * Request the views of a person, unless they were requested within the interval. Called often.
   *
   * @param {number} object
   */
  async refresh(object) {
    const now = performance.now();
    if (object === this.#object && now - this.#requestedAt < INTERVAL_MS) return;
    if (object !== this.#object) this.views = [];
    this.#object = object;
    this.#requestedAt = now;
    const last = now - this.#fullRequestAt < FULL_INTERVAL_MS ? this.views.at(-1) : undefined;
    if (!last) this.#fullRequestAt = now;
    try {
      const { views } = await getJson(`api/objects/${object}/past${last ? `?from=p${last.first}` : ''}`);
      if (object !== this.#object) return;
      const received = /** @type {any[]} */ (views).map((view) => ({ ...view, end: view.first + view.frames }));
      this.views = last ? [...this.views.filter((view) => view.end <= last.first), ...received] : received;
    } catch {
      // Nothing is recorded, or the server is unreachable: keep the known views.
    }
  }

  /** Delete all views: the pulses have restarted. */
  clear() {
    this.views = [];
    this.#object = null;
  }

  /**
   * @param {number} from pulse
   * @param {number} until pulse
   * @returns {View[]} clipped to [from, until)
   */
  between(from, until) {
    const inside = this.views.filter((view) => view.end > from && view.first < until);
    return inside.map(({ camera, first, end }) => ({ camera, first: Math.max(first, from), end: Math.min(end, until) }));
  }
}
