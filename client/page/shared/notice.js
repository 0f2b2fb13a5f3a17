/** A notice that disappears after some seconds. */

const DURATION_MS = 10_000;

export class Notice {
  #text = '';
  #shownAt = -Infinity;

  /** @param {string} text */
  show(text) {
    this.#text = text;
    this.#shownAt = performance.now();
  }

  /** @returns {string} empty: none, or it has expired */
  get text() {
    return performance.now() - this.#shownAt < DURATION_MS ? this.#text : '';
  }
}
