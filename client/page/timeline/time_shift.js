/** Where in time somebody watches: what happens now, or a moment of the past and on from there; or it stands. */

/** @import {Viewer} from '../viewer.js' */

/**
 * @typedef {object} Moment
 * @property {number} pulse
 * @property {number} time of that pulse: media time, seconds
 */

const LIVE_S = 2; // who is less behind the newest decision than this is live

export class TimeShift {
  /** @type {Moment | null} where the past that is watched began; null: it is live */
  moment = null;
  /** Whether the picture is of pulses that have begun anew since. */
  stale = false;
  #resumed = false; // it is watched because the picture was paused, not because somebody wished to look back
  #asleep = false; // paused by a browser that nobody looks at, not by hand

  /**
   * @param {HTMLVideoElement} video
   * @param {Viewer} viewer
   */
  constructor(video, viewer) {
    this.video = video;
    this.viewer = viewer;
    video.addEventListener('pause', () => (this.#asleep = document.hidden));
    document.addEventListener('visibilitychange', () => {
      if (!document.hidden && this.#asleep && video.paused) this.live();
    });
  }

  /**
   * @param {number} wanted pulse to see again, from there on
   * @param {boolean} resumed it is where the picture was paused
   */
  watchFrom(wanted, resumed = false) {
    const { site, object, probe, decisions, format } = this.viewer;
    if (!site || object === null || probe.pulse === null) return;
    const pulse = Math.max(0, wanted);
    if (this.stale || pulse >= decisions.end - LIVE_S * site.fps) return this.live();
    if (format.container === 'webm') return this.#lose(); // of such a site nothing is kept
    this.moment = { pulse, time: pulse / site.fps };
    this.#resumed = resumed;
    this.viewer.goOn();
  }

  /** From now on what happens now. */
  live() {
    this.moment = null;
    this.viewer.goOn();
  }

  /** @param {number} seconds to go on, or back, from the frame now shown */
  skip(seconds) {
    const { site, probe } = this.viewer;
    if (site && probe.pulse !== null) this.watchFrom(probe.pulse + Math.round(seconds * site.fps));
  }

  /** Stop the picture, or go on with it where it stopped. */
  pause() {
    if (this.video.paused) this.#resume();
    else this.video.pause();
  }

  /** The picture goes on, and not because the page said so. */
  resumed() {
    if (this.#asleep) this.live();
    else this.#resume();
  }

  /** @param {boolean} refused nothing is kept of this past; else it is over */
  ended(refused) {
    if (refused) this.#lose();
    else this.live();
  }

  /** Whoever is watched next, or by which camera, is watched from the moment of the past that is now shown. */
  moveOn() {
    const { site, player } = this.viewer;
    if (!site || !this.moment || player.shown?.past !== this.moment) return;
    const pulse = Math.floor(player.mediaTime(this.video.currentTime) * site.fps);
    this.moment = { pulse, time: pulse / site.fps };
  }

  /** Pulses have begun anew: their numbers mean other moments. */
  beginAnew() {
    this.moment = null;
    this.stale = this.viewer.probe.pulse !== null;
  }

  #resume() {
    const { probe, player } = this.viewer;
    if (probe.pulse === null) player.play();
    else this.watchFrom(probe.pulse, true);
  }

  #lose() {
    // Who was paused after somebody had left has lost nothing: there is no picture of them since.
    const left = this.#resumed && !this.viewer.chosen?.visible;
    if (!left) this.viewer.notice.say('Nothing is recorded of that time: this is live.');
    this.live();
  }
}
