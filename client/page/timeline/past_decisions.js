/** Decisions older than those the page keeps, requested while that past is watched. */

import { Decisions } from './decisions.js';

const REQUEST_S = 20; // of decisions per request
const AHEAD_S = 6; // requested before they are needed
const TIMEOUT_MS = 10_000;
const RETRY_MS = 2000; // after an answer without the decisions

export class PastDecisions {
  #requesting = false;
  #retryAt = -Infinity;

  /**
   * @param {number} fps
   * @param {() => void} received
   */
  constructor(fps, received) {
    this.fps = fps;
    this.received = received;
    this.decisions = new Decisions(fps);
  }

  /**
   * Request missing decisions around a pulse. Called often.
   *
   * @param {number} pulse displayed
   * @param {number} known pulse from which on the page has the decisions
   */
  request(pulse, known) {
    const ahead = Math.round(AHEAD_S * this.fps);
    const missing = [pulse, pulse + ahead].find((needed) => needed < known && !this.decisions.at(needed));
    if (missing === undefined || this.#requesting || performance.now() < this.#retryAt) return;
    void this.#fetch(missing, Math.min(missing + Math.round(REQUEST_S * this.fps), known));
  }

  /**
   * @param {number} from
   * @param {number} to
   */
  async #fetch(from, to) {
    this.#requesting = true;
    try {
      const signal = AbortSignal.timeout(TIMEOUT_MS);
      const response = await fetch(`api/past?from=p${from}&to=p${to}`, { cache: 'no-store', signal });
      const lines = response.ok ? (await response.text()).split('\n') : [];
      const gops = lines.filter(Boolean).map((line) => JSON.parse(line));
      // In an earlier run of the service the same numbers were other people's.
      for (const gop of gops) if (gop.run === undefined) this.decisions.add(gop);
    } catch {
      // The video plays without boxes.
    }
    this.#requesting = false;
    if (!this.decisions.at(from)) this.#retryAt = performance.now() + RETRY_MS;
    this.received();
  }
}
