/** Time shift: live playback, playback of the past, and pausing. */

/** @import {Viewer} from '../viewer.js' */

/**
 * @typedef {object} Moment
 * @property {number} pulse
 * @property {number} time media time of that pulse, seconds
 */

const LIVE_S = 2; // closer than this to the newest decision, playback is live

export class TimeShift {
  /** @type {Moment | null} where playback of the past started; null: live */
  moment = null;
  /** Whether the displayed pulse is from before the pulses restarted. */
  stale = false;
  #resumedPause = false; // the past is played because the video was paused, not because a moment was chosen
  #pausedByBrowser = false; // on a hidden page

  /**
   * @param {HTMLVideoElement} video
   * @param {Viewer} viewer
   */
  constructor(video, viewer) {
    this.video = video;
    this.viewer = viewer;
    video.addEventListener('pause', () => (this.#pausedByBrowser = document.hidden));
    document.addEventListener('visibilitychange', () => {
      if (!document.hidden && this.#pausedByBrowser && video.paused) this.live();
    });
  }

  /**
   * Play from a pulse on.
   *
   * @param {number} from pulse
   * @param {boolean} resumedPause whether that is where the video was paused
   */
  watchFrom(from, resumedPause = false) {
    const { site, object, decisions, format } = this.viewer;
    if (!site || object === null) return;
    const pulse = Math.max(0, from);
    if (site.blur) {
      if (!resumedPause) this.viewer.showNotice('People are blurred only in live pictures.');
      return this.live();
    }
    if (this.stale || pulse >= decisions.end - LIVE_S * site.fps) return this.live();
    if (format.container === 'webm') return this.#notRecorded(); // VP8 is not recorded
    if (format.transcoded) {
      if (!resumedPause) this.viewer.showNotice('This browser cannot play the recordings’ codec, only live pictures.');
      return this.live();
    }
    this.moment = { pulse, time: pulse / site.fps };
    this.#resumedPause = resumedPause;
    this.viewer.play();
  }

  /** Return to live playback. */
  live() {
    this.moment = null;
    this.viewer.play();
  }

  /** @param {number} seconds from the displayed frame; negative: back */
  skip(seconds) {
    const { site, probe } = this.viewer;
    if (site && probe.pulse !== null) this.watchFrom(probe.pulse + Math.round(seconds * site.fps));
  }

  /** Pause, or resume where the video was paused. */
  togglePause() {
    if (this.video.paused) this.#resume();
    else this.video.pause();
  }

  /** The video plays again, and the page did not start it. */
  resumed() {
    if (this.#pausedByBrowser) this.live();
    else this.#resume();
  }

  /** @param {boolean} refused there is no such recording; false: it has ended */
  ended(refused) {
    if (refused) this.#notRecorded();
    else this.live();
  }

  /** Keep the displayed moment of the past for the next person or camera. */
  keepMoment() {
    const { site, player } = this.viewer;
    if (!site || !this.moment || player.shown?.past !== this.moment) return;
    const pulse = Math.floor(player.mediaTime(this.video.currentTime) * site.fps);
    this.moment = { pulse, time: pulse / site.fps };
  }

  /** The site's pulses have restarted: pulses now mean other moments. */
  pulsesRestarted() {
    this.moment = null;
    this.stale = this.viewer.probe.pulse !== null;
  }

  #resume() {
    const { probe, player } = this.viewer;
    if (probe.pulse === null) player.play();
    else this.watchFrom(probe.pulse, true);
  }

  #notRecorded() {
    // After a pause of a person who has left, nothing is missed: there is no later video of them.
    const nothingMissed = this.#resumedPause && !this.viewer.selected?.visible;
    if (!nothingMissed) this.viewer.notice.show('There is no recording of that time. This is live.');
    this.live();
  }
}
