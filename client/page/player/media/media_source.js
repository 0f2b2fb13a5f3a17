/** Media Source Extensions: opening a MediaSource on a video element, and its SourceBuffer. */

const KEPT_S = 20; // behind the displayed frame: some to look back at, little enough for a phone
const KEPT_WHEN_FULL_S = 2;
const TRIM_STEP_S = 5; // trimming at every frame would be wasteful

/** @type {typeof MediaSource | undefined} iPhones have only ManagedMediaSource */
export const MediaSourceClass = /** @type {any} */ (globalThis).ManagedMediaSource ?? globalThis.MediaSource;

/**
 * @param {string} container mp4 or webm
 * @param {string} codec
 * @returns {boolean} whether this browser can play such streams
 */
export function canPlay(container, codec) {
  return Boolean(MediaSourceClass?.isTypeSupported(mimeType(container, codec)));
}

/**
 * Open a new MediaSource on a video element, replacing its current source.
 *
 * @param {HTMLVideoElement} video
 * @param {string} container
 * @param {string} codec
 * @returns {Promise<MediaBuffer>} to append segments to
 */
export async function openMediaSource(video, container, codec) {
  const source = new /** @type {typeof MediaSource} */ (MediaSourceClass)();
  const address = URL.createObjectURL(source);
  video.src = address;
  await new Promise((resolve) => source.addEventListener('sourceopen', resolve, { once: true }));
  URL.revokeObjectURL(address);
  return new MediaBuffer(source.addSourceBuffer(mimeType(container, codec)));
}

/**
 * @param {string} container
 * @param {string} codec
 */
function mimeType(container, codec) {
  return `video/${container}; codecs="${codec}"`;
}

/**
 * A SourceBuffer whose operations are queued.
 *
 * All streams of a site share one timeline (media time = pulse / fps), so one buffer serves the whole visit:
 * another person's stream overwrites the same media times.
 */
export class MediaBuffer {
  /** @type {Promise<void>} */
  #lastOperation = Promise.resolve();

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
   * @param {number} time media time displayed now or next: what is long before it may be removed
   * @returns {Promise<void>}
   */
  append(bytes, time) {
    return this.#queue(async () => {
      if (this.#startsBefore(time - KEPT_S - TRIM_STEP_S)) await this.#remove(0, time - KEPT_S);
      try {
        await this.#updateEnd(() => this.buffer.appendBuffer(/** @type {BufferSource} */ (bytes)));
      } catch (error) {
        if (!(error instanceof DOMException) || error.name !== 'QuotaExceededError') throw error;
        await this.#remove(0, time - KEPT_WHEN_FULL_S);
        await this.#updateEnd(() => this.buffer.appendBuffer(/** @type {BufferSource} */ (bytes)));
      }
    });
  }

  /**
   * @param {number} start seconds
   * @param {number} end seconds, may be Infinity
   * @returns {Promise<void>}
   */
  remove(start, end) {
    return this.#queue(() => this.#remove(start, end));
  }

  /** @param {number} time */
  #startsBefore(time) {
    return this.buffer.buffered.length > 0 && this.buffer.buffered.start(0) < time;
  }

  /**
   * @param {number} start
   * @param {number} end
   */
  async #remove(start, end) {
    // While nothing is buffered there may be no duration, and remove() would throw.
    if (!this.buffer.buffered.length || end <= start) return;
    await this.#updateEnd(() => this.buffer.remove(Math.max(0, start), end));
  }

  /**
   * @param {() => Promise<void>} operation
   * @returns {Promise<void>}
   */
  #queue(operation) {
    const result = this.#lastOperation.then(operation);
    this.#lastOperation = result.catch(() => undefined); // only this caller gets the error, not the next one
    return result;
  }

  /**
   * @param {() => void} start
   * @returns {Promise<void>}
   */
  #updateEnd(start) {
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
        reject(new Error('the browser cannot decode the video'));
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
