/**
 * One SourceBuffer whose operations wait for each other.
 *
 * The timeline is shared by everybody's streams (media time = pulse / fps), so one buffer serves the
 * whole visit: another person's stream is written over the same moments.
 */

const KEPT_S = 20; // behind the picture: enough to look back at, little enough for a phone
const KEPT_WHEN_FULL_S = 2;
const TRIM_STEP_S = 5; // trimming at every frame would be work for nothing

export class MediaBuffer {
  /** @type {Promise<void>} */
  #turn = Promise.resolve();

  /** @param {SourceBuffer} buffer */
  constructor(buffer) {
    this.buffer = buffer;
    buffer.mode = 'segments';
  }

  /** @returns {[number, number][]} */
  get ranges() {
    const { buffered } = this.buffer;
    return Array.from({ length: buffered.length }, (_, i) => [buffered.start(i), buffered.end(i)]);
  }

  /**
   * @param {Uint8Array} bytes whole segments
   * @param {number} time media time now shown, or to be shown next: what is long before it may go
   * @returns {Promise<void>}
   */
  append(bytes, time) {
    return this.#queue(async () => {
      if (this.#startsBefore(time - KEPT_S - TRIM_STEP_S)) await this.#cut(0, time - KEPT_S);
      try {
        await this.#settled(() => this.buffer.appendBuffer(/** @type {BufferSource} */ (bytes)));
      } catch (error) {
        if (!(error instanceof DOMException) || error.name !== 'QuotaExceededError') throw error;
        await this.#cut(0, time - KEPT_WHEN_FULL_S);
        await this.#settled(() => this.buffer.appendBuffer(/** @type {BufferSource} */ (bytes)));
      }
    });
  }

  /**
   * @param {number} start seconds
   * @param {number} end seconds, may be Infinity
   * @returns {Promise<void>}
   */
  remove(start, end) {
    return this.#queue(() => this.#cut(start, end));
  }

  /** @param {number} time */
  #startsBefore(time) {
    return this.buffer.buffered.length > 0 && this.buffer.buffered.start(0) < time;
  }

  /**
   * @param {number} start
   * @param {number} end
   */
  async #cut(start, end) {
    // While nothing is buffered there may not even be a duration, and remove() would refuse.
    if (!this.buffer.buffered.length || end <= start) return;
    await this.#settled(() => this.buffer.remove(Math.max(0, start), end));
  }

  /**
   * @param {() => Promise<void>} work
   * @returns {Promise<void>}
   */
  #queue(work) {
    const mine = this.#turn.then(work);
    this.#turn = mine.catch(() => undefined); // the failure belongs to who asked, not to who is next
    return mine;
  }

  /**
   * @param {() => void} start
   * @returns {Promise<void>}
   */
  #settled(start) {
    return new Promise((resolve, reject) => {
      const { buffer } = this;
      const done = () => {
        buffer.removeEventListener('updateend', done);
        buffer.removeEventListener('error', failed);
        resolve();
      };
      const failed = () => {
        buffer.removeEventListener('updateend', done);
        buffer.removeEventListener('error', failed);
        reject(new Error('the browser could not read the video'));
      };
      buffer.addEventListener('updateend', done);
      buffer.addEventListener('error', failed);
      try {
        start();
      } catch (error) {
        buffer.removeEventListener('updateend', done);
        buffer.removeEventListener('error', failed);
        reject(error);
      }
    });
  }
}
