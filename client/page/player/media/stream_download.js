/** Downloads a person's stream as whole segments, and requests it again whenever it fails. */

import { Backoff } from '../../shared/backoff.js';
import { atLeastTwoGops } from '../latency_control.js';
import { SegmentSplitter } from './mp4.js';
import { ClusterSplitter } from './webm.js';
import { HttpError, pause } from '../../shared/requests.js';
import { currentServer, leaveServer, silenceS } from '../../shared/servers.js';
import { streamUrl } from '../stream_selection.js';

/** @import {Segment} from './mp4.js' */
/** @import {Moment} from '../../timeline/time_shift.js' */
/** @import {StreamSelection} from '../stream_selection.js' */

const IDLE_S = 6; // a live stream without data for this long is treated as broken
const REPLACED_MS = 100; // before another service is asked

/**
 * @typedef {object} DownloadListener
 * @property {(download: StreamDownload, segments: Segment[]) => Promise<void>} received
 * @property {(refused: boolean) => void} ended a past stream has ended; refused: there is no such recording
 * @property {() => number} bufferedEnd media time up to which the stream is buffered
 */

export class StreamDownload {
  /** Media time of the first frame since the last request; NaN: none was received. */
  start = NaN;
  /** performance.now() when that frame was in the buffer; NaN before. */
  bufferedAt = NaN;
  /** Whether a frame was received. */
  hasFrames = false;
  /** Whether the element displays this stream. */
  onScreen = false;
  /** @type {Segment[]} audio received before the first video segment */
  earlyAudio = [];
  #controller = new AbortController();

  /**
   * @param {StreamSelection} selection
   * @param {number} gopS seconds of a GOP, which may arrive in one burst
   */
  constructor(selection, gopS) {
    this.selection = selection;
    this.gopS = gopS;
  }

  get cancelled() {
    return this.#controller.signal.aborted;
  }

  cancel() {
    this.#controller.abort();
  }

  /**
   * Download until cancelled, or until a past stream ends.
   *
   * @param {string} container
   * @param {boolean} transcoded whether to ask for H.264 that is encoded anew
   * @param {DownloadListener} listener
   */
  async run(container, transcoded, { received, ended, bufferedEnd }) {
    const { signal } = this.#controller;
    const backoff = new Backoff();
    let from = this.selection.past;
    while (!this.cancelled) {
      let refused = false;
      let broken = false;
      let replaced = false;
      const server = currentServer();
      try {
        const address = streamUrl(this.selection, container, from, transcoded);
        for await (const segments of downloadSegments(address, signal, this.gopS)) {
          await received(this, segments);
          if (this.cancelled) return;
          backoff.reset();
        }
      } catch (error) {
        // Server unreachable, person unknown and the like: retry.
        if (!this.cancelled) console.info(`stream of person ${this.selection.object}: ${error}`);
        refused = error instanceof HttpError && error.permanent;
        broken = !refused;
        replaced = broken && !this.cancelled && leaveServer(server);
      }
      if (this.cancelled) return;
      if (from && !broken) return ended(refused);
      if (from && this.hasFrames) from = advance(from, bufferedEnd());
      this.start = this.bufferedAt = NaN;
      this.earlyAudio = [];
      const wait = backoff.next();
      await pause(replaced ? Math.min(wait, REPLACED_MS) : wait, signal);
    }
  }
}

/**
 * @param {Moment} from
 * @param {number} time media time, seconds
 * @returns {Moment} the moment at that time, or `from` where that is not later
 */
function advance(from, time) {
  return from.time > 0 && time > from.time ? { pulse: Math.floor((time * from.pulse) / from.time), time } : from;
}

/**
 * Yield the whole segments of a stream in groups, as they arrive; return when the stream ends.
 *
 * @param {string} address of an MP4, or of a WebM by its extension
 * @param {AbortSignal} signal
 * @param {number} gopS seconds of a GOP
 * @returns {AsyncGenerator<Segment[], void>}
 * @throws {Error} when there is no such stream, or it fails or is idle for too long
 */
async function* downloadSegments(address, signal, gopS) {
  const request = new AbortController();
  // A busy service may begin late; what has begun and then is silent has stopped.
  let timer = setTimeout(() => request.abort(), 1000 * atLeastTwoGops(IDLE_S, gopS));
  const abort = () => request.abort(); // AbortSignal.any is missing on the oldest supported iPhones
  signal.addEventListener('abort', abort);
  if (signal.aborted) abort();
  try {
    const response = await fetch(address, { cache: 'no-store', signal: request.signal });
    if (!response.ok || !response.body) throw new HttpError(`${address}: ${response.status}`, response.status);
    const reader = response.body.getReader();
    const splitter = address.split('?')[0].endsWith('.webm') ? new ClusterSplitter() : new SegmentSplitter();
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      clearTimeout(timer);
      timer = setTimeout(() => request.abort(), 1000 * atLeastTwoGops(silenceS(IDLE_S), gopS));
      const segments = splitter.push(value);
      if (segments.length) yield segments;
    }
  } finally {
    clearTimeout(timer);
    signal.removeEventListener('abort', abort);
    request.abort(); // close the connection when the consumer stops early
  }
}
