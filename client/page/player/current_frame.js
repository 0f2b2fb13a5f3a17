/** The frame now shown: which moment it is, who is in it and where, and which part of it is looked at. */

import { Framing } from './viewport.js';

/** @import {Box} from '../shared/contract.js' */
/** @import {Decisions} from '../timeline/decisions.js' */
/** @import {Part} from './viewport_follow.js' */
/** @import {Frame} from './frames.js' */
/** @import {Subject} from './subject.js' */
/** @import {Viewer} from '../viewer.js' */

const STANDING_MS = 1500; // without a new frame the picture counts as standing

export class NowShown {
  /** As the browser counts it, seconds. */
  mediaTime = 0;
  /** It is known which pulse that is. */
  mapped = true;
  /** @type {Box[]} */
  boxes = [];
  /** @type {Part | null} where the person is followed; null: all of it */
  part = null;
  framing = new Framing();
  /** @type {number | null} milliseconds that the server's clock is ahead; set from outside */
  clockOffset = null;
  #at = -Infinity;

  /** @param {Viewer} viewer */
  constructor(viewer) {
    this.viewer = viewer;
  }

  /** @param {Frame} frame */
  take({ mediaTime, shownAt }) {
    const { site, player, probe, travel } = this.viewer;
    const pulse = Math.round(player.mediaTime(mediaTime) * (site?.fps ?? 1));
    const passed = mediaTime - this.mediaTime;
    this.mediaTime = mediaTime;
    this.mapped = !Number.isNaN(pulse);
    if (!this.mapped) return this.#takeUnmapped(shownAt);
    // The same moment may be shown again, of somebody else.
    if (pulse !== probe.pulse) {
      this.#at = performance.now();
      travel.stale = false;
      probe.frame({ pulse, shownAt, delayMs: this.#delay(pulse, shownAt) });
    }
    if (!site || !player.shown) return;
    const { object, past } = player.shown;
    if (past) this.viewer.recall.want(pulse, this.viewer.decisions.begin);
    const said = this.viewer.said(pulse);
    const camera = cameraOf(player.shown, said, pulse);
    probe.view(object, camera, shownAt);
    this.boxes = probe.boxes = camera === null ? [] : said.boxes(camera, pulse);
    const box = this.boxes.find(([number]) => number === object);
    this.part = this.framing.step(`${object} ${camera}`, box, site, passed);
  }

  /** @returns {boolean} whether a picture has been shown */
  get any() {
    return this.#at > -Infinity;
  }

  /** @returns {boolean} whether new frames are being shown */
  get flowing() {
    return performance.now() - this.#at < STANDING_MS;
  }

  /**
   * It is not known which frame this is: it is shown, and nothing is said of it.
   *
   * @param {number} shownAt
   */
  #takeUnmapped(shownAt) {
    const { player, probe } = this.viewer;
    this.#at = performance.now();
    this.boxes = [];
    this.part = null;
    if (player.shown) probe.view(player.shown.object, null, shownAt);
  }

  /**
   * @param {number} pulse
   * @param {number} shownAt
   */
  #delay(pulse, shownAt) {
    const { site } = this.viewer;
    if (!site || site.pulse0 === null || this.clockOffset === null) return null;
    return shownAt + this.clockOffset - (site.pulse0 + pulse / site.fps) * 1000;
  }
}

/**
 * @param {Subject} subject
 * @param {Decisions} said
 * @param {number} pulse
 */
function cameraOf({ object, camera, prefer }, said, pulse) {
  if (camera !== null) return camera;
  return prefer === null ? said.camera(object, pulse) : said.preferring(object, prefer, pulse);
}
