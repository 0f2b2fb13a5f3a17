/**
 * The best view of one person after another, live, in one video element that is never reloaded.
 *
 * Media Source Extensions: switching person leaves the old download and continues with the new
 * stream's init segment in the same SourceBuffer, over the same moments.
 */

import { Backoff } from './backoff.js';
import { MediaBuffer } from './buffer.js';
import { download } from './download.js';
import { pause } from './http.js';
import { join } from './mp4.js';
import { Pace } from './pace.js';

/** @import {Segment} from './mp4.js' */

const TICK_MS = 100;
const RESTARTED_S = 10; // a stream that begins this far back is of a site whose pulses began anew
const LANDING_MS = 300; // how long a new stream may take to reach the moment now shown
const PAUSED_S = 30; // of video that waits behind a paused picture; then the download stops
const INSIDE_S = 0.001; // a seek to the very start of a range may round to just before it

/**
 * @typedef {object} Subject
 * @property {number} object who is to be seen
 * @property {string | null} camera by which; null: by whichever sees them best
 * @property {Moment | null} past where to begin; null: live
 *
 * @typedef {object} Moment
 * @property {number} pulse
 * @property {number} time of that pulse: media time, seconds
 */

/**
 * One download of one person's stream.
 *
 * @typedef {object} Run
 * @property {Subject} subject
 * @property {AbortController} leave
 * @property {number} start media time of its first frame; NaN before that came
 * @property {number} since performance.now() of when its first frame was in the buffer; NaN before
 * @property {boolean} landed whether the picture now comes from it
 * @property {Segment[]} early sound that has come before the first picture
 */

/** @type {typeof MediaSource | undefined} iPhones have only the managed kind */
const Source = /** @type {any} */ (globalThis).ManagedMediaSource ?? globalThis.MediaSource;

export class Player {
  /** @type {Run | null} */
  #run = null;
  /** @type {Promise<MediaBuffer> | null} */
  #buffer = null;
  /** @type {MediaBuffer | null} */
  #opened = null;
  /** @type {Run | null} whose first picture the element is about to show */
  #landing = null;
  #pace = new Pace();
  /** @type {number} */
  #ticking;
  #codec = '';
  #container = 'mp4';
  /** @type {Subject | null} whose picture the element shows */
  shown = null;
  /** @type {Subject | null} whose stream was left because the picture was paused for long */
  #left = null;

  /**
   * @param {HTMLVideoElement} video
   * @param {object} listener
   * @param {() => void} listener.landed the picture is now of who was chosen last
   * @param {() => void} listener.ended there is nothing more of this past
   * @param {() => void} listener.resumed the picture is to go on where it stopped, and its stream has been left
   */
  constructor(video, listener) {
    this.video = video;
    this.listener = listener;
    video.disableRemotePlayback = true; // or the managed kind does not open
    video.addEventListener('waiting', () => {
      if (!video.seeking && this.#run?.landed) this.#pace.stalled();
    });
    video.addEventListener('error', () => this.#reopen());
    video.addEventListener('play', () => {
      if (!this.#run && this.shown) this.listener.resumed();
    });
    this.#ticking = setInterval(() => this.#tick(), TICK_MS);
  }

  /**
   * @param {string} container mp4 or webm
   * @param {string} codec of the pictures, and after a comma of the sound if there is any
   * @returns {boolean} whether this browser can play such streams at all
   */
  configure(container, codec) {
    if (!Source?.isTypeSupported(mime(container, codec))) return false;
    if (container !== this.#container || codec !== this.#codec) {
      this.#container = container;
      this.#codec = codec;
      this.#reopen();
    }
    return true;
  }

  /** @param {Subject} subject whom to show from now on */
  choose(subject) {
    if (this.#run && same(this.#run.subject, subject)) return;
    if (this.#left && same(this.#left, subject) && this.video.paused) return;
    this.#left = null;
    this.#run?.leave.abort();
    this.#run = begin(subject);
    void this.#follow(this.#run);
  }

  #reopen() {
    const subject = this.#run?.subject;
    this.#run?.leave.abort();
    this.#run = this.#landing = null;
    this.#opened = null;
    this.#buffer = this.#open();
    if (subject) this.choose(subject);
  }

  /** @returns {Promise<MediaBuffer>} */
  async #open() {
    const source = new /** @type {typeof MediaSource} */ (Source)();
    const address = URL.createObjectURL(source);
    this.video.src = address;
    await new Promise((resolve) => source.addEventListener('sourceopen', resolve, { once: true }));
    URL.revokeObjectURL(address);
    this.#opened = new MediaBuffer(source.addSourceBuffer(mime(this.#container, this.#codec)));
    this.video.play().catch(() => undefined); // the page says that it is paused, and how to go on
    return this.#opened;
  }

  /** @param {Run} run */
  async #follow(run) {
    const { signal } = run.leave;
    const backoff = new Backoff();
    while (!signal.aborted) {
      try {
        for await (const segments of download(address(run.subject, this.#container), signal)) {
          await this.#take(run, segments);
          if (signal.aborted) return;
          backoff.reset();
        }
      } catch (error) {
        // Whatever it was (the server away, the person not known yet), the answer is to try again.
        if (!signal.aborted) console.info(`the stream of ${run.subject.object}: ${error}`);
      }
      if (signal.aborted) return;
      if (run.subject.past) return this.listener.ended();
      run.start = run.since = NaN;
      run.early = [];
      await pause(backoff.next(), signal);
    }
  }

  /**
   * @param {Run} run
   * @param {Segment[]} segments
   */
  async #take(run, segments) {
    const buffer = await /** @type {Promise<MediaBuffer>} */ (this.#buffer);
    if (run.leave.signal.aborted) return;
    const first = segments.find((segment) => segment.kind === 'media');
    if (!first && Number.isNaN(run.start) && segments.some((segment) => segment.kind === 'sound')) {
      run.early.push(...segments); // when the first picture tells where it begins, the old stream is cut off there
      return;
    }
    if (first && Number.isNaN(run.start)) {
      run.start = first.start;
      // Nothing of the old stream may be met again behind the edge of the new one.
      const anew = run.subject.past !== null || run.start < this.video.currentTime - RESTARTED_S;
      if (anew) run.landed = false;
      await buffer.remove(anew ? 0 : run.start, Infinity);
      if (run.leave.signal.aborted) return;
    }
    const all = [...run.early.splice(0), ...segments];
    await buffer.append(join(all.map((segment) => segment.bytes)), this.video.currentTime);
    if (!first) return;
    if (Number.isNaN(run.since)) run.since = performance.now();
    this.#land(run, buffer);
  }

  /**
   * Make the element show the new stream now: a seek drops the frames it has already decoded.
   *
   * @param {Run} run
   * @param {MediaBuffer} buffer
   */
  #land(run, buffer) {
    if (run.landed || run !== this.#run || Number.isNaN(run.since)) return;
    const end = buffer.ranges.at(-1)?.[1] ?? 0;
    const { past } = run.subject;
    if (past) {
      if (end > past.time) this.#landAt(run, Math.max(past.time, run.start) + INSIDE_S);
      return;
    }
    const time = this.video.currentTime;
    const within = run.start <= time && time < end;
    const before = time < run.start || run.start < time - RESTARTED_S;
    if (!within && !before && performance.now() - run.since < LANDING_MS) return;
    this.#landAt(run, within ? time : run.start + INSIDE_S);
  }

  /**
   * @param {Run} run
   * @param {number} time
   */
  #landAt(run, time) {
    run.landed = true;
    this.#landing = run;
    this.video.addEventListener('seeked', () => this.#showing(run), { once: true });
    this.#seek(time);
    if (this.video.paused) this.video.play().catch(() => undefined);
  }

  /** @returns {boolean} whether it is open just now if the picture is still of who was shown before */
  get landing() {
    return this.#landing !== null;
  }

  /** @param {Run} run */
  #showing(run) {
    if (run !== this.#landing) return;
    this.#landing = null;
    this.shown = run.subject;
    this.listener.landed();
  }

  /** @param {number} time */
  #seek(time) {
    this.#pace.reset();
    this.video.currentTime = time;
  }

  #tick() {
    const { video } = this;
    const run = this.#run;
    const buffer = this.#opened;
    if (!run || !buffer) return;
    this.#land(run, buffer);
    if (!run.landed) return;
    const { ranges } = buffer;
    if (video.paused) {
      if ((ranges.at(-1)?.[1] ?? 0) - video.currentTime > PAUSED_S) {
        this.stop();
        this.#left = run.subject;
      }
      return;
    }
    if (run.subject.past) {
      video.playbackRate = 1;
      return;
    }
    const step = this.#pace.step(performance.now() / 1000, video.currentTime, ranges);
    if (step.seek !== null) this.#seek(step.seek);
    if (video.playbackRate !== step.rate) video.playbackRate = step.rate;
  }

  /** Leave the stream and the element, for good. */
  close() {
    this.stop();
    clearInterval(this.#ticking);
    this.video.removeAttribute('src');
    this.video.load();
  }

  /** Leave the stream; the last frame stays. */
  stop() {
    this.#run?.leave.abort();
    this.#run = this.#left = null;
  }
}

/**
 * @param {Subject} subject
 * @param {string} container
 */
function address({ object, camera, past }, container) {
  const name = encodeURIComponent(camera ?? '');
  if (past && camera !== null) return `cameras/${name}/live.${container}?from=p${past.pulse}`;
  const query = past ? `?from=p${past.pulse}` : camera === null ? '' : `?camera=${name}`;
  return `objects/${object}/best.${container}${query}`;
}

/**
 * @param {Subject} one
 * @param {Subject} other
 */
function same(one, other) {
  return one.object === other.object && one.camera === other.camera && one.past?.pulse === other.past?.pulse;
}

/**
 * @param {Subject} subject
 * @returns {Run}
 */
function begin(subject) {
  return { subject, leave: new AbortController(), start: NaN, since: NaN, landed: false, early: [] };
}

/**
 * @param {string} container
 * @param {string} codec
 */
function mime(container, codec) {
  return `video/${container}; codecs="${codec}"`;
}
