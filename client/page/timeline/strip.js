/** The timeline under the picture: the views of the past colored by camera, decided views to come, and its range. */

import { Surface } from '../player/surface.js';

/** @import {View} from './recorded_views.js' */
/** @import {Palette} from '../people/palette.js' */

const AHEAD = 1 / 30; // share of the past's length that is reserved for decided views to come
const GAP = 1; // CSS pixels cut out of the strip at every cut
const MIN_WIDTH = 0.5; // CSS pixels of a view: the shortest shots of an hour stay visible
const FONT = '600 11px system-ui, sans-serif';
const DECIDED_ALPHA = 0.45; // of decided views that are not displayed yet

/** @type {[number, string][]} seconds and label */
const RANGES = [
  [60, 'Last minute'],
  [600, 'Last 10 minutes'],
  [3600, 'Last hour'],
  [21_600, 'Last 6 hours'],
  [86_400, 'Last day'],
  [604_800, 'Last week'],
];

/**
 * @typedef {object} StripState
 * @property {number} pulse displayed
 * @property {boolean} live whether playback is live
 * @property {number} fps
 * @property {number} seconds of the past
 * @property {number} decided the first undecided pulse
 * @property {(from: number) => View[]} views displayed or decided from a pulse on, in order
 * @property {Palette} palette
 */

export class TimelineStrip {
  /** @type {{end: number, frames: number} | null} end and length of the past drawn last, in pulses */
  #range = null;

  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.surface = new Surface(canvas);
  }

  clear() {
    this.#range = null;
    this.surface.clear();
  }

  /**
   * @param {number} x CSS pixels from the left edge
   * @returns {number | null} the pulse drawn there; null: none, or not displayed yet
   */
  pulseAt(x) {
    if (!this.#range) return null;
    const { end, frames } = this.#range;
    const pulse = Math.round(end - frames + (x / this.surface.width) * (1 + AHEAD) * frames);
    return pulse < end ? pulse : null;
  }

  /** @param {StripState} state */
  draw({ pulse, live, fps, seconds, decided, views, palette }) {
    const context = this.surface.clear();
    const { width, height } = this.surface;
    // While the past is watched, the strip stays at the newest pulse and a mark shows the displayed one.
    const end = live ? pulse : Math.max(pulse, decided);
    const frames = seconds * fps;
    this.#range = { end, frames };
    const from = end - frames;
    const perFrame = width / ((1 + AHEAD) * frames);
    /** @param {number} at */
    const x = (at) => (at - from) * perFrame;
    for (const view of views(from)) {
      const left = x(view.first);
      const right = Math.max(Math.min(x(view.end), width) - GAP, left + MIN_WIDTH);
      context.fillStyle = palette.color(view.camera);
      context.fillRect(left, 0, right - left, height);
      drawName(context, view.camera, left, right, height);
    }
    shadeUpcoming(context, x(end), width, height);
    if (!live) drawMark(context, x(pulse), height);
  }
}

/** The select element for the range of the timeline, with as many ranges as are recorded. */
export class RangeSelect {
  /**
   * @param {HTMLSelectElement} select
   * @param {HTMLElement} strip
   * @param {() => void} changed
   */
  constructor(select, strip, changed) {
    this.select = select;
    select.setAttribute('aria-controls', strip.id);
    this.#offer(1);
    select.addEventListener('change', changed);
  }

  /**
   * Offer the ranges up to the first that covers the recording.
   *
   * @param {number} recordedSeconds 0 or less: nothing is recorded, or unknown
   * @returns {number} the selected range, seconds
   */
  update(recordedSeconds) {
    const covering = RANGES.findIndex(([seconds]) => recordedSeconds <= seconds);
    this.#offer(recordedSeconds > 0 ? (covering < 0 ? RANGES.length : covering + 1) : 1);
    return Number(this.select.value);
  }

  /** @param {number} count of ranges */
  #offer(count) {
    const { select } = this;
    if (select.options.length === count || select === document.activeElement) return; // do not change it while in use
    const selected = select.value;
    const ranges = RANGES.slice(0, count);
    select.replaceChildren(...ranges.map(([seconds, label]) => new Option(label, String(seconds))));
    if (ranges.some(([seconds]) => String(seconds) === selected)) select.value = selected;
    select.disabled = count < 2;
  }
}

/**
 * Write the camera's name where it fits, so that colors need not be told apart.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {string} camera
 * @param {number} left
 * @param {number} right
 * @param {number} height
 */
function drawName(context, camera, left, right, height) {
  context.font = FONT;
  if (context.measureText(camera).width + 10 > right - left) return;
  context.textBaseline = 'middle';
  context.fillStyle = 'rgba(0, 0, 0, 0.8)';
  context.fillText(camera, left + 5, height / 2 + 0.5);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number} now where decided views that are not displayed yet begin
 * @param {number} width
 * @param {number} height
 */
function shadeUpcoming(context, now, width, height) {
  context.fillStyle = `rgba(16, 17, 18, ${1 - DECIDED_ALPHA})`;
  context.fillRect(now, 0, width - now, height);
  drawMark(context, now, height);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number} x
 * @param {number} height
 */
function drawMark(context, x, height) {
  context.fillStyle = '#101112';
  context.fillRect(x - 2, 0, 4, height);
  context.fillStyle = '#fff';
  context.fillRect(x - 1, 0, 2, height);
}
