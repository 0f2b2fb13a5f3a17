/**
 * The server's clock, as seen from here: what the measured delay is measured against.
 *
 * As in NTP, of several samples the one with the shortest round trip says most: the offset is wrong by
 * half that round trip at the most.
 */

const SAMPLES = 8;

export class ServerClock {
  /** @type {{offset: number, roundTrip: number}[]} */
  #samples = [];

  /**
   * @param {number} sent Date.now() when the question went out, milliseconds
   * @param {number} received Date.now() when the answer came, milliseconds
   * @param {number} now the server's unix seconds in the answer
   */
  add(sent, received, now) {
    this.#samples.push({ offset: now * 1000 - (sent + received) / 2, roundTrip: received - sent });
    if (this.#samples.length > SAMPLES) this.#samples.shift();
  }

  /** Forget: another server may have another clock. */
  clear() {
    this.#samples = [];
  }

  /** @returns {number | null} milliseconds that the server's clock is ahead of this one */
  get offset() {
    if (!this.#samples.length) return null;
    return this.#samples.reduce((best, s) => (s.roundTrip < best.roundTrip ? s : best)).offset;
  }
}
