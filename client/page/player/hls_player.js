/**
 * Plays the best view by the browser's native HLS, where there are no Media Source Extensions.
 *
 * Each person is another source. The browser chooses the origin of a source's media time; where it reports the
 * wall-clock time of that origin (getStartDate), frames are mapped to pulses, otherwise there are no boxes.
 */

import { Backoff } from '../shared/backoff.js';
import { Playback } from './playback.js';
import { pause } from '../shared/requests.js';
import { isSameSelection, playlistUrl } from './stream_selection.js';

/** @import {PlayerListener} from './mse_player.js' */
/** @import {StreamFormat} from './create_player.js' */
/** @import {StreamSelection} from './stream_selection.js' */

const TYPE = 'application/vnd.apple.mpegurl';
const MAX_BEHIND_S = 15; // behind the live edge, when playback is resumed
const LIVE_BUFFER_S = 3; // kept to the live edge after a jump there
const SAME_TIMELINE_S = 1; // a frame time further from the element's is the stream's own

export class HlsPlayer {
  /** @type {StreamSelection | null} what the element displays */
  shown = null;
  /** @type {StreamSelection | null} */
  #selection = null;
  #backoff = new Backoff();
  #playback;
  #pulse0 = NaN; // Unix seconds of the site's media time 0

  /**
   * @param {HTMLVideoElement} video
   * @param {PlayerListener} listener
   */
  constructor(video, listener) {
    this.video = video;
    this.listener = listener;
    this.#playback = new Playback(video, () => this.shown && !this.isSwitching() && listener.resumed());
    video.addEventListener('loadeddata', () => this.#loaded());
    video.addEventListener('ended', () => this.#ended());
    video.addEventListener('error', () => this.#fail());
  }

  /**
   * @param {StreamFormat} format
   * @returns {boolean} whether this browser can play the format
   */
  configure({ container, pulse0 }) {
    this.#pulse0 = pulse0 ?? NaN;
    return container === 'mp4' && this.video.canPlayType(TYPE) !== '';
  }

  /** @param {StreamSelection} selection to play from now on */
  select(selection) {
    if (this.#selection && isSameSelection(this.#selection, selection)) return;
    this.#selection = selection;
    this.#load();
  }

  /** Resume; a live stream that is far behind jumps to the live edge. */
  play() {
    const { video } = this;
    const { seekable } = video;
    const edge = seekable.length ? seekable.end(seekable.length - 1) : 0;
    const late = edge - video.currentTime > MAX_BEHIND_S;
    if (video.paused && !this.#selection?.past && late) video.currentTime = edge - LIVE_BUFFER_S;
    this.#playback.start();
  }

  /** @returns {boolean} whether the element may still display the previous selection */
  isSwitching() {
    return this.#selection !== null && this.#selection !== this.shown;
  }

  /**
   * @param {number} time of a frame, as the browser reports it
   * @returns {number} media time of the site, pulse / fps; NaN: unknown
   */
  mediaTime(time) {
    if (Math.abs(time - this.video.currentTime) > SAME_TIMELINE_S) return time;
    const { getStartDate } = /** @type {{getStartDate?: () => Date}} */ (/** @type {unknown} */ (this.video));
    return time + (getStartDate?.call(this.video).getTime() ?? NaN) / 1000 - this.#pulse0;
  }

  /** Stop playing; the last frame stays. */
  stop() {
    this.video.pause();
    this.#selection = null;
  }

  /** Release the stream and the element. */
  close() {
    this.stop();
    this.video.removeAttribute('src');
    this.video.load();
  }

  #load() {
    if (!this.#selection) return;
    this.video.src = playlistUrl(this.#selection);
    this.play();
  }

  #loaded() {
    this.#backoff.reset();
    this.shown = this.#selection;
    if (this.shown) this.listener.switched();
  }

  #ended() {
    if (this.#selection?.past) this.listener.ended(false);
    else void this.#retry();
  }

  /** A video element does not expose the HTTP status, so a past playlist is requested once more for it. */
  async #fail() {
    const selection = this.#selection;
    if (!selection) return;
    if (selection.past) {
      const answer = await fetch(playlistUrl(selection), { method: 'HEAD', cache: 'no-store' }).catch(() => null);
      if (selection !== this.#selection) return;
      if (answer && answer.status >= 400 && answer.status < 500) return this.listener.ended(true);
    }
    void this.#retry();
  }

  async #retry() {
    const selection = this.#selection;
    await pause(this.#backoff.next());
    if (selection === this.#selection) this.#load();
  }
}
