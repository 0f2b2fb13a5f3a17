/**
 * Plays the best view of one person after another in one video element that is never reloaded.
 *
 * Media Source Extensions: a switch to another person cancels the download and appends the new stream's
 * init segment and media to the same SourceBuffer, over the same media times.
 */

import { Backoff } from '../shared/backoff.js';
import { afterSeek } from './frames.js';
import { Playback } from './playback.js';
import { pause } from '../shared/requests.js';
import { hasRestarted, mayBelongTo, switchTime } from './stream_switch.js';
import { concat } from './media/mp4.js';
import { canPlay, openMediaSource } from './media/media_source.js';
import { LatencyController } from './latency_control.js';
import { StreamDownload } from './media/stream_download.js';
import { isSameSelection } from './stream_selection.js';

/** @import {MediaBuffer} from './media/media_source.js' */
/** @import {Segment} from './media/mp4.js' */
/** @import {StreamFormat} from './create_player.js' */
/** @import {StreamSelection} from './stream_selection.js' */

const TICK_MS = 100;
const MAX_PAUSED_S = 30; // of video buffered behind a paused picture; then the download is cancelled
const ERROR_FREE_MS = 10_000; // after which the backoff starts again

/**
 * @typedef {object} PlayerListener
 * @property {() => void} switched the element displays the last selection
 * @property {(refused: boolean) => void} ended a past stream has ended; refused: there is no such recording
 * @property {() => void} resumed a paused video plays again, and the page did not start it
 */

export class MsePlayer {
  /** @type {StreamDownload | null} */
  #download = null;
  /** @type {Promise<MediaBuffer> | null} */
  #buffer = null;
  /** @type {MediaBuffer | null} */
  #openedBuffer = null;
  /** @type {StreamDownload | null} whose first frame the element is about to display */
  #switchingTo = null;
  #latency = new LatencyController();
  /** @type {number} */
  #ticking;
  #codec = '';
  #gopS = 0;
  #container = 'mp4';
  #transcoded = false;
  #playback;
  #backoff = new Backoff();
  #failedAt = -Infinity; // performance.now() of the last error
  #openCount = 0; // how often the element was opened
  #waitingToOpen = false;
  /** @type {StreamSelection | null} what the element displays */
  shown = null;
  /** @type {StreamSelection | null} whose download was cancelled because the video was paused for long */
  #suspended = null;

  /**
   * @param {HTMLVideoElement} video
   * @param {PlayerListener} listener
   */
  constructor(video, listener) {
    this.video = video;
    this.listener = listener;
    video.disableRemotePlayback = true; // or ManagedMediaSource does not open
    video.addEventListener('waiting', () => {
      if (!video.seeking && this.#download?.onScreen) this.#latency.stalled();
    });
    video.addEventListener('error', () => this.#fail());
    const onScreen = () => this.shown && (!this.#download || this.#download.onScreen);
    this.#playback = new Playback(video, () => onScreen() && listener.resumed());
    this.#ticking = setInterval(() => this.#tick(), TICK_MS);
  }

  /**
   * @param {StreamFormat} format
   * @returns {boolean} whether this browser can play the format
   */
  configure({ container, codec, transcoded, gopS }) {
    if (!canPlay(container, codec)) return false;
    this.#gopS = this.#latency.gopS = gopS;
    if (container !== this.#container || codec !== this.#codec || transcoded !== this.#transcoded) {
      this.#container = container;
      this.#transcoded = transcoded;
      this.#codec = codec;
      this.#reopen();
    }
    return true;
  }

  /** @param {StreamSelection} selection to play from now on */
  select(selection) {
    if (this.#download && isSameSelection(this.#download.selection, selection)) return;
    if (this.#suspended && isSameSelection(this.#suspended, selection) && this.video.paused) return;
    this.#suspended = null;
    this.#download?.cancel();
    this.#download = new StreamDownload(selection, this.#gopS);
    void this.#download.run(this.#container, this.#transcoded, {
      received: (download, segments) => this.#append(download, segments),
      ended: (refused) => this.listener.ended(refused),
      bufferedEnd: () => this.#openedBuffer?.ranges.at(-1)?.[1] ?? 0,
    });
  }

  /** Resume at the current position. */
  play() {
    this.#playback.start();
  }

  /** Reopen after an error, with backoff: what follows undecodable data may be undecodable too. */
  #fail() {
    if (this.#waitingToOpen) return;
    if (performance.now() - this.#failedAt > ERROR_FREE_MS) this.#backoff.reset();
    this.#failedAt = performance.now();
    this.#reopen(this.#backoff.next());
  }

  /** @param {number} waitMs before opening */
  #reopen(waitMs = 0) {
    const selection = this.#download?.selection;
    this.#download?.cancel();
    this.#download = this.#switchingTo = null;
    this.#openedBuffer = null;
    this.#buffer = this.#open(waitMs);
    if (selection) this.select(selection);
  }

  /**
   * @param {number} waitMs before opening
   * @returns {Promise<MediaBuffer>} of the latest opening
   */
  async #open(waitMs) {
    const count = ++this.#openCount;
    this.#waitingToOpen = waitMs > 0;
    if (waitMs) await pause(waitMs);
    if (count !== this.#openCount) return /** @type {Promise<MediaBuffer>} */ (this.#buffer);
    this.#waitingToOpen = false;
    const buffer = await openMediaSource(this.video, this.#container, this.#codec);
    this.#openedBuffer = buffer;
    this.play();
    return buffer;
  }

  /**
   * @param {StreamDownload} download
   * @param {Segment[]} segments
   */
  async #append(download, segments) {
    const buffer = await /** @type {Promise<MediaBuffer>} */ (this.#buffer);
    if (download.cancelled) return;
    const first = segments.find((segment) => segment.kind === 'media');
    if (!first && Number.isNaN(download.start) && segments.some((segment) => segment.kind === 'audio')) {
      download.earlyAudio.push(...segments); // the old stream is cut off where the first video segment starts
      return;
    }
    if (first && Number.isNaN(download.start)) {
      const restarted = hasRestarted(first.start, this.video.currentTime, download.gopS);
      if (restarted && download.onScreen && this.video.paused) return this.#suspend(download); // the old frame stays
      download.start = first.start;
      // Remove the old stream beyond the new one's start, or playback would run into it.
      const discontinuous = restarted || (download.selection.past !== null && !download.hasFrames);
      if (discontinuous) download.onScreen = false;
      download.hasFrames = true;
      await buffer.remove(discontinuous ? 0 : download.start, Infinity);
      if (download.cancelled) return;
    }
    const all = [...download.earlyAudio.splice(0), ...segments];
    // Video from before the current time is kept while the element is yet to seek to it.
    const seekTarget = download.onScreen || Number.isNaN(download.start) ? Infinity : download.start;
    await buffer.append(concat(all.map((segment) => segment.bytes)), Math.min(this.video.currentTime, seekTarget));
    if (!first) return;
    if (Number.isNaN(download.bufferedAt)) download.bufferedAt = performance.now();
    this.#switchTo(download, buffer);
  }

  /**
   * Display the new stream by a seek, which drops the frames that are already decoded.
   *
   * @param {StreamDownload} download
   * @param {MediaBuffer} buffer
   */
  #switchTo(download, buffer) {
    if (download.onScreen || download !== this.#download || Number.isNaN(download.bufferedAt)) return;
    const end = buffer.ranges.at(-1)?.[1] ?? 0;
    const time = switchTime(download, end, this.video.currentTime, performance.now());
    if (time === null) return;
    download.onScreen = true;
    this.#switchingTo = download;
    this.video.addEventListener('seeked', () => afterSeek(this.video, () => this.#finishSwitch(download)), { once: true });
    this.#seek(time);
    this.play();
  }

  /**
   * @param {number} time of a frame, as the browser reports it
   * @returns {number} media time of the site, pulse / fps
   */
  mediaTime(time) {
    return time;
  }

  /**
   * @param {number} time of a frame, as the browser reports it
   * @returns {boolean} whether the frame may be of another selection than `shown`
   */
  isSwitching(time) {
    return this.#switchingTo !== null || (this.#download !== null && mayBelongTo(this.#download, time));
  }

  /** @param {StreamDownload} download */
  #finishSwitch(download) {
    if (download !== this.#switchingTo) return;
    this.#switchingTo = null;
    this.shown = download.selection;
    this.listener.switched();
  }

  /** @param {number} time */
  #seek(time) {
    this.#latency.reset();
    this.video.currentTime = time;
  }

  #tick() {
    const { video } = this;
    const download = this.#download;
    const buffer = this.#openedBuffer;
    if (!download || !buffer) return;
    this.#switchTo(download, buffer);
    if (!download.onScreen) return;
    const { ranges } = buffer;
    if (this.#playback.paused) {
      if ((ranges.at(-1)?.[1] ?? 0) - video.currentTime > MAX_PAUSED_S) this.#suspend(download);
      return;
    }
    if (download.selection.past) {
      video.playbackRate = 1;
      return;
    }
    const step = this.#latency.step(performance.now() / 1000, video.currentTime, ranges);
    if (step.seek !== null) this.#seek(step.seek);
    if (video.playbackRate !== step.rate) video.playbackRate = step.rate;
  }

  /** Release the stream and the element. */
  close() {
    this.stop();
    this.#switchingTo = null;
    this.#openCount += 1;
    this.#buffer = null;
    clearInterval(this.#ticking);
    this.video.removeAttribute('src');
    this.video.load();
  }

  /** Stop playing; the last frame stays. */
  stop() {
    this.#download?.cancel();
    this.#download = this.#suspended = null;
  }

  /** @param {StreamDownload} download to cancel until the paused video is resumed */
  #suspend(download) {
    this.stop();
    this.#suspended = download.selection;
  }
}
