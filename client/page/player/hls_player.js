/**
 * The best view where there are no Media Source Extensions: HLS, which such browsers play by themselves.
 *
 * Another person is another source. A browser counts the time of such a source as it likes; where it tells what time
 * of day its beginning is (getStartDate), frames have their pulses, and else there are no boxes.
 */

import { Backoff } from '../shared/backoff.js';
import { Going } from './autoplay.js';
import { pause } from '../shared/requests.js';
import { playlistOf, same } from './subject.js';

/** @import {Listener} from './player.js' */
/** @import {Form} from './players.js' */
/** @import {Subject} from './subject.js' */

const TYPE = 'application/vnd.apple.mpegurl';
const FAR_S = 15; // behind the newest that the browser would go to
const BEHIND_S = 3; // it, so that there is something to play
const SAME_S = 1; // a frame whose time is further from the element's has that of the stream itself

export class HlsPlayer {
  /** @type {Subject | null} whose picture the element shows */
  shown = null;
  /** @type {Subject | null} */
  #subject = null;
  #backoff = new Backoff();
  #going;
  #pulse0 = NaN; // unix seconds at which media time 0 of the site was

  /**
   * @param {HTMLVideoElement} video
   * @param {Listener} listener
   */
  constructor(video, listener) {
    this.video = video;
    this.listener = listener;
    this.#going = new Going(video, () => this.shown && !this.landing && listener.resumed());
    video.addEventListener('loadeddata', () => this.#showing());
    video.addEventListener('ended', () => this.#end());
    video.addEventListener('error', () => this.#fail());
  }

  /**
   * @param {Form} form
   * @returns {boolean} whether this browser can play such streams at all
   */
  configure({ container, pulse0 }) {
    this.#pulse0 = pulse0 ?? NaN;
    return container === 'mp4' && this.video.canPlayType(TYPE) !== '';
  }

  /** @param {Subject} subject whom to show from now on */
  choose(subject) {
    if (this.#subject && same(this.#subject, subject)) return;
    this.#subject = subject;
    this.#load();
  }

  /** Let the picture go on; live, from where it is live. */
  play() {
    const { video } = this;
    const { seekable } = video;
    const edge = seekable.length ? seekable.end(seekable.length - 1) : 0;
    if (video.paused && !this.#subject?.past && edge - video.currentTime > FAR_S) video.currentTime = edge - BEHIND_S;
    this.#going.on();
  }

  /** @returns {boolean} whether it is open just now if the picture is still of who was shown before */
  get landing() {
    return this.#subject !== null && this.#subject !== this.shown;
  }

  /**
   * @param {number} time of a frame, as the browser tells it
   * @returns {number} media time of the site, pulse / fps; NaN: not known
   */
  mediaTime(time) {
    if (Math.abs(time - this.video.currentTime) > SAME_S) return time;
    const { getStartDate } = /** @type {{getStartDate?: () => Date}} */ (/** @type {unknown} */ (this.video));
    return time + (getStartDate?.call(this.video).getTime() ?? NaN) / 1000 - this.#pulse0;
  }

  /** Leave the stream; the last frame stays. */
  stop() {
    this.video.pause();
    this.#subject = null;
  }

  /** Leave the stream and the element, for good. */
  close() {
    this.stop();
    this.video.removeAttribute('src');
    this.video.load();
  }

  #load() {
    if (!this.#subject) return;
    this.video.src = playlistOf(this.#subject);
    this.play();
  }

  #showing() {
    this.#backoff.reset();
    this.shown = this.#subject;
    if (this.shown) this.listener.landed();
  }

  #end() {
    if (this.#subject?.past) this.listener.ended(false);
    else void this.#again();
  }

  /** A video element does not tell what the server said. */
  async #fail() {
    const subject = this.#subject;
    if (!subject) return;
    if (subject.past) {
      const answer = await fetch(playlistOf(subject), { method: 'HEAD', cache: 'no-store' }).catch(() => null);
      if (subject !== this.#subject) return;
      if (answer && answer.status >= 400 && answer.status < 500) return this.listener.ended(true);
    }
    void this.#again();
  }

  async #again() {
    const subject = this.#subject;
    await pause(this.#backoff.next());
    if (subject === this.#subject) this.#load();
  }
}
