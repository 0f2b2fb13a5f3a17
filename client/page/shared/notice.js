/** What is worth a moment's notice: said for a while, and then no more. */

const NOTICE_MS = 10_000;

export class Notice {
  #text = '';
  #at = -Infinity;

  /** @param {string} text */
  say(text) {
    this.#text = text;
    this.#at = performance.now();
  }

  /** @returns {string} what was said just now; empty: nothing */
  get text() {
    return performance.now() - this.#at < NOTICE_MS ? this.#text : '';
  }
}
