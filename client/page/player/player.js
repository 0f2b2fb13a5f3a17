/**
 * The best view of one person after another, live, in one video element that is never reloaded.
 *
 * Media Source Extensions: switching person leaves the old download and continues with the new
 * stream's init segment in the same SourceBuffer, over the same moments.
 */

import { Backoff } from '../shared/backoff.js';
import { arrived } from './frames.js';
import { Going } from './autoplay.js';
import { pause } from '../shared/requests.js';
import { begunAnew, landingOf } from './cut_over.js';
import { join } from './media/mp4.js';
import { opened, plays } from './opening.js';
import { Pace } from './pace.js';
import { Run } from './media/stream_download.js';
import { same } from './subject.js';

/** @import {MediaBuffer} from './media/buffer.js' */
/** @import {Segment} from './media/mp4.js' */
/** @import {Form} from './players.js' */
/** @import {Subject} from './subject.js' */

const TICK_MS = 100;
const PAUSED_S = 30; // of video that waits behind a paused picture; then the download stops
const WELL_MS = 10_000; // without an error: the next one is a new one

/**
 * @typedef {object} Listener
 * @property {() => void} landed the picture is now of who was chosen last
 * @property {(refused: boolean) => void} ended there is nothing more of this past, or nothing is kept of it at all
 * @property {() => void} resumed a picture that had stopped goes on, and not because the page said so
 */

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
  #gopS = 0;
  #container = 'mp4';
  #going;
  #backoff = new Backoff();
  #failed = -Infinity; // performance.now() of the last error
  #turn = 0; // how often the element has been opened
  #waits = false; // before it is opened again
  /** @type {Subject | null} whose picture the element shows */
  shown = null;
  /** @type {Subject | null} whose stream was left because the picture was paused for long */
  #left = null;
  /**
   * @param {HTMLVideoElement} video
   * @param {Listener} listener
   */
  constructor(video, listener) {
    this.video = video;
    this.listener = listener;
    video.disableRemotePlayback = true; // or the managed kind does not open
    video.addEventListener('waiting', () => {
      if (!video.seeking && this.#run?.landed) this.#pace.stalled();
    });
    video.addEventListener('error', () => this.#fail());
    this.#going = new Going(video, () => this.shown && (!this.#run || this.#run.landed) && listener.resumed());
    this.#ticking = setInterval(() => this.#tick(), TICK_MS);
  }

  /**
   * @param {Form} form
   * @returns {boolean} whether this browser can play such streams at all
   */
  configure({ container, codec, gopS }) {
    if (!plays(container, codec)) return false;
    this.#gopS = this.#pace.gopS = gopS;
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
    this.#run?.leave();
    this.#run = new Run(subject, this.#gopS);
    void this.#run.follow(this.#container, {
      take: (run, segments) => this.#take(run, segments),
      ended: (refused) => this.listener.ended(refused),
      reached: () => this.#opened?.ranges.at(-1)?.[1] ?? 0,
    });
  }

  /** Let the picture go on, wherever it is. */
  play() {
    this.#going.on();
  }

  /** What cannot be decoded may be followed by more that cannot: it is asked for again at a bearable rate. */
  #fail() {
    if (this.#waits) return;
    if (performance.now() - this.#failed > WELL_MS) this.#backoff.reset();
    this.#failed = performance.now();
    this.#reopen(this.#backoff.next());
  }

  /** @param {number} wait milliseconds until then */
  #reopen(wait = 0) {
    const subject = this.#run?.subject;
    this.#run?.leave();
    this.#run = this.#landing = null;
    this.#opened = null;
    this.#buffer = this.#open(wait);
    if (subject) this.choose(subject);
  }

  /**
   * @param {number} wait milliseconds until then
   * @returns {Promise<MediaBuffer>} of the element as it was opened last
   */
  async #open(wait) {
    const turn = ++this.#turn;
    this.#waits = wait > 0;
    if (wait) await pause(wait);
    if (turn !== this.#turn) return /** @type {Promise<MediaBuffer>} */ (this.#buffer);
    this.#waits = false;
    const buffer = await opened(this.video, this.#container, this.#codec);
    this.#opened = buffer;
    this.play();
    return buffer;
  }

  /**
   * @param {Run} run
   * @param {Segment[]} segments
   */
  async #take(run, segments) {
    const buffer = await /** @type {Promise<MediaBuffer>} */ (this.#buffer);
    if (run.left) return;
    const first = segments.find((segment) => segment.kind === 'media');
    if (!first && Number.isNaN(run.start) && segments.some((segment) => segment.kind === 'sound')) {
      run.early.push(...segments); // when the first picture tells where it begins, the old stream is cut off there
      return;
    }
    if (first && Number.isNaN(run.start)) {
      const again = begunAnew(first.start, this.video.currentTime, run.gopS);
      if (again && run.landed && this.video.paused) return this.#leaveFor(run); // the old picture stays
      run.start = first.start;
      // Nothing of the old stream may be met again behind the edge of the new one.
      const anew = again || (run.subject.past !== null && !run.begun);
      if (anew) run.landed = false;
      run.begun = true;
      await buffer.remove(anew ? 0 : run.start, Infinity);
      if (run.left) return;
    }
    const all = [...run.early.splice(0), ...segments];
    // What comes of a past is not long over while the picture is still to go there.
    const goes = run.landed || Number.isNaN(run.start) ? Infinity : run.start;
    await buffer.append(join(all.map((segment) => segment.bytes)), Math.min(this.video.currentTime, goes));
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
    const time = landingOf(run, end, this.video.currentTime, performance.now());
    if (time === null) return;
    run.landed = true;
    this.#landing = run;
    this.video.addEventListener('seeked', () => arrived(this.video, () => this.#showing(run)), { once: true });
    this.#seek(time);
    this.play();
  }

  /**
   * @param {number} time of a frame, as the browser tells it
   * @returns {number} media time of the site, pulse / fps
   */
  mediaTime(time) {
    return time;
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
      if ((ranges.at(-1)?.[1] ?? 0) - video.currentTime > PAUSED_S) this.#leaveFor(run);
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
    this.#landing = null;
    this.#turn += 1;
    this.#buffer = null;
    clearInterval(this.#ticking);
    this.video.removeAttribute('src');
    this.video.load();
  }

  /** Leave the stream; the last frame stays. */
  stop() {
    this.#run?.leave();
    this.#run = this.#left = null;
  }

  /** @param {Run} run whose stream is left until the picture, which is paused, goes on */
  #leaveFor(run) {
    this.stop();
    this.#left = run.subject;
  }
}
