/** How far back somebody can be seen again, and by which cameras they were shown: asked now and then. */

import { getJson } from '../shared/requests.js';

/**
 * @typedef {object} View frames [first, end) of one camera
 * @property {string} camera
 * @property {number} first
 * @property {number} end
 */

const EVERY_MS = 30_000;
const ALL_EVERY_MS = 600_000; // in between only what is new is asked for: of a week there is much

export class Kept {
  /** @type {View[]} in order */
  views = [];
  #asked = -Infinity;
  #allAsked = -Infinity;
  /** @type {number | null} */
  #about = null;

  /** @returns {number} the first pulse that is kept; Infinity where nothing is, or it is not known */
  get first() {
    return this.views[0]?.first ?? Infinity;
  }

  /**
   * Ask, unless this was asked lately. Called often.
   *
   * @param {number} object
   */
  async about(object) {
    const now = performance.now();
    if (object === this.#about && now - this.#asked < EVERY_MS) return;
    if (object !== this.#about) this.views = [];
    this.#about = object;
    this.#asked = now;
    const last = now - this.#allAsked < ALL_EVERY_MS ? this.views.at(-1) : undefined;
    if (!last) this.#allAsked = now;
    try {
      const { views } = await getJson(`api/objects/${object}/past${last ? `?from=p${last.first}` : ''}`);
      if (object !== this.#about) return;
      const since = /** @type {any[]} */ (views).map((it) => ({ ...it, end: it.first + it.frames }));
      this.views = last ? [...this.views.filter((it) => it.end <= last.first), ...since] : since;
    } catch {
      // Nothing is kept of them, or the server is away: what was known before may still be so.
    }
  }

  /** Pulses began anew. */
  forget() {
    this.views = [];
    this.#about = null;
  }

  /**
   * @param {number} from pulse
   * @param {number} until pulse
   * @returns {View[]}
   */
  between(from, until) {
    const inside = this.views.filter((it) => it.end > from && it.first < until);
    return inside.map(({ camera, first, end }) => ({ camera, first: Math.max(first, from), end: Math.min(end, until) }));
  }
}
