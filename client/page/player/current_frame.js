/** The displayed frame: its pulse, its boxes, and the viewport in which it is shown. */

import { PersonViewport } from './viewport.js';

/** @import {Box} from '../shared/api_types.js' */
/** @import {Decisions} from '../timeline/decisions.js' */
/** @import {Viewport} from './viewport.js' */
/** @import {Frame} from './frames.js' */
/** @import {StreamSelection} from './stream_selection.js' */
/** @import {Viewer} from '../viewer.js' */

const STALLED_MS = 1500; // without a new frame the video counts as stalled

export class CurrentFrame {
  /** Media time as the browser reports it, seconds. */
  mediaTime = 0;
  /** Whether the frame's pulse is known. */
  mapped = true;
  /** @type {Box[]} */
  boxes = [];
  /** @type {Viewport | null} the part of the frame that is shown; null: all of it */
  viewport = null;
  follow = new PersonViewport();
  /** @type {number | null} milliseconds that the server's clock is ahead, set by SitePoller */
  clockOffset = null;
  #shownAt = -Infinity; // performance.now()

  /** @param {Viewer} viewer */
  constructor(viewer) {
    this.viewer = viewer;
  }

  /** @param {Frame} frame now displayed */
  update({ mediaTime, shownAt }) {
    const { site, player, probe, timeShift } = this.viewer;
    const pulse = Math.round(player.mediaTime(mediaTime) * (site?.fps ?? 1));
    const elapsed = mediaTime - this.mediaTime;
    this.mediaTime = mediaTime;
    this.mapped = !Number.isNaN(pulse);
    if (!this.mapped) return this.#updateUnmapped(shownAt);
    // After a switch to another person the same pulse may be shown again.
    if (pulse !== probe.pulse) {
      this.#shownAt = performance.now();
      timeShift.stale = false;
      probe.frame({ pulse, shownAt, delayMs: this.#delay(pulse, shownAt) });
    }
    if (!site || !player.shown) return;
    const { object, past } = player.shown;
    if (past) this.viewer.pastDecisions.request(pulse, this.viewer.decisions.begin);
    const decisions = this.viewer.decisionsAt(pulse);
    const camera = cameraOf(player.shown, decisions, pulse);
    probe.view(object, camera, shownAt);
    this.boxes = probe.boxes = camera === null ? [] : decisions.boxes(camera, pulse);
    const box = this.boxes.find(([number]) => number === object);
    this.viewport = this.follow.step(`${object} ${camera}`, box, site, elapsed);
  }

  /** @returns {boolean} whether a frame has been displayed */
  get exists() {
    return this.#shownAt > -Infinity;
  }

  /** @returns {boolean} whether new frames are being displayed */
  get advancing() {
    return performance.now() - this.#shownAt < STALLED_MS;
  }

  /**
   * Show a frame of unknown pulse: without camera, boxes and viewport.
   *
   * @param {number} shownAt
   */
  #updateUnmapped(shownAt) {
    const { player, probe } = this.viewer;
    this.#shownAt = performance.now();
    this.boxes = [];
    this.viewport = null;
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
 * @param {StreamSelection} selection
 * @param {Decisions} decisions
 * @param {number} pulse
 */
function cameraOf({ object, camera, prefer }, decisions, pulse) {
  if (camera !== null) return camera;
  return prefer === null ? decisions.camera(object, pulse) : decisions.preferring(object, prefer, pulse);
}
