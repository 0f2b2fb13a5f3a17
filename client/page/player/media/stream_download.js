/** One person's stream being downloaded, and asked for again whenever it fails. */

import { Backoff } from '../../shared/backoff.js';
import { download } from './segment_download.js';
import { pause, Refused } from '../../shared/requests.js';
import { streamOf } from '../subject.js';

/** @import {Segment} from './mp4.js' */
/** @import {Moment} from '../../timeline/time_shift.js' */
/** @import {Subject} from '../subject.js' */

/**
 * @typedef {object} Taker
 * @property {(run: Run, segments: Segment[]) => Promise<void>} take
 * @property {(refused: boolean) => void} ended there is nothing more of this past, or nothing is kept of it at all
 * @property {() => number} reached media time up to which the past has come
 */

export class Run {
  /** Media time of the first frame since it was last asked for; NaN before that came. */
  start = NaN;
  /** performance.now() of when that frame was in the buffer; NaN before. */
  since = NaN;
  /** Whether any frame has come yet. */
  begun = false;
  /** Whether the picture now comes from it. */
  landed = false;
  /** @type {Segment[]} sound that has come before the first picture */
  early = [];
  #leave = new AbortController();

  /**
   * @param {Subject} subject
   * @param {number} gopS seconds of a GOP, which may come all at once
   */
  constructor(subject, gopS) {
    this.subject = subject;
    this.gopS = gopS;
  }

  get left() {
    return this.#leave.signal.aborted;
  }

  leave() {
    this.#leave.abort();
  }

  /**
   * Until it is left, or a past is over.
   *
   * @param {string} container
   * @param {Taker} taker
   */
  async follow(container, { take, ended, reached }) {
    const { signal } = this.#leave;
    const backoff = new Backoff();
    let from = this.subject.past;
    while (!this.left) {
      let refused = false;
      let broken = false;
      try {
        for await (const segments of download(streamOf(this.subject, container, from), signal, this.gopS)) {
          await take(this, segments);
          if (this.left) return;
          backoff.reset();
        }
      } catch (error) {
        // Whatever it was (the server away, the person not known yet), the answer is to try again.
        if (!this.left) console.info(`the stream of ${this.subject.object}: ${error}`);
        refused = error instanceof Refused && error.forGood;
        broken = !refused;
      }
      if (this.left) return;
      if (from && !broken) return ended(refused);
      if (from && this.begun) from = onwards(from, reached());
      this.start = this.since = NaN;
      this.early = [];
      await pause(backoff.next(), signal);
    }
  }
}

/**
 * @param {Moment} from
 * @param {number} time seconds, of media
 * @returns {Moment} that one, by the same frames to a second
 */
function onwards(from, time) {
  return from.time > 0 && time > from.time ? { pulse: Math.floor((time * from.pulse) / from.time), time } : from;
}
