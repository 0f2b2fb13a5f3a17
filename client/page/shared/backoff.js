/** How long to wait before trying again: soon at first, never longer than two seconds. */

const FIRST_MS = 250;
const LONGEST_MS = 2000;

export class Backoff {
  #next = FIRST_MS;

  /** It worked: the next failure is tried again soon. */
  reset() {
    this.#next = FIRST_MS;
  }

  /** @returns {number} milliseconds to wait now */
  next() {
    const wait = this.#next;
    this.#next = Math.min(2 * wait, LONGEST_MS);
    return wait;
  }
}
