/** Exponential backoff between retries, up to two seconds. */

const FIRST_MS = 250;
const MAX_MS = 2000;

export class Backoff {
  #next = FIRST_MS;

  /** Start again at the shortest wait, after a success. */
  reset() {
    this.#next = FIRST_MS;
  }

  /** @returns {number} milliseconds to wait now */
  next() {
    const wait = this.#next;
    this.#next = Math.min(2 * wait, MAX_MS);
    return wait;
  }
}
