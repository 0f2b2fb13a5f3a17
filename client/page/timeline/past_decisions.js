/** What was decided longer ago than the page remembers: asked for as that past is watched. */

import { Decisions } from './decisions.js';

const AT_ONCE_S = 20;
const AHEAD_S = 6; // so much before it is needed
const PATIENCE_MS = 10_000;
const REST_MS = 2000; // after an answer that did not help

export class PastDecisions {
  #asking = false;
  #tired = -Infinity; // until when nothing is asked

  /**
   * @param {number} fps
   * @param {() => void} come
   */
  constructor(fps, come) {
    this.fps = fps;
    this.come = come;
    this.decisions = new Decisions(fps);
  }

  /**
   * Called often.
   *
   * @param {number} pulse that is shown
   * @param {number} known from this pulse on the page knows by itself
   */
  request(pulse, known) {
    const ahead = Math.round(AHEAD_S * this.fps);
    const missing = [pulse, pulse + ahead].find((it) => it < known && !this.decisions.at(it));
    if (missing === undefined || this.#asking || performance.now() < this.#tired) return;
    void this.#ask(missing, Math.min(missing + Math.round(AT_ONCE_S * this.fps), known));
  }

  /**
   * @param {number} from
   * @param {number} to
   */
  async #ask(from, to) {
    this.#asking = true;
    try {
      const signal = AbortSignal.timeout(PATIENCE_MS);
      const response = await fetch(`api/past?from=p${from}&to=p${to}`, { cache: 'no-store', signal });
      const lines = response.ok ? (await response.text()).split('\n') : [];
      const gops = lines.filter(Boolean).map((line) => JSON.parse(line));
      // What an earlier run of the service has said is of other people under the same numbers.
      for (const gop of gops) if (gop.run === undefined) this.decisions.add(gop);
    } catch {
      // The picture goes on without boxes.
    }
    this.#asking = false;
    if (!this.decisions.at(from)) this.#tired = performance.now() + REST_MS;
    this.come();
  }
}
