/** The last minute or more as a band coloured by camera, and a little of what is already decided beyond. */

import { Surface } from '../player/surface.js';

/** @import {View} from './available_past.js' */
/** @import {Palette} from '../people/palette.js' */

const AHEAD = 1 / 30; // of the past that is shown
const GAP = 1; // CSS pixels cut out of the band at every cut
const LEAST = 0.5; // of a band: an hour's shortest shots are seen too
const LETTERS = '600 11px system-ui, sans-serif';
const DECIDED_ALPHA = 0.45; // decided, not yet shown

/**
 * @typedef {object} Moment what the strip shows
 * @property {number} pulse now shown
 * @property {boolean} live whether it is the newest
 * @property {number} fps
 * @property {number} seconds of the past
 * @property {number} decided the first pulse that nothing is decided for yet
 * @property {(from: number) => View[]} views that were shown from a pulse on, in order
 * @property {Palette} palette
 */

export class Strip {
  /** @type {{end: number, frames: number} | null} of what was drawn last: where the past ends, and its length */
  #moment = null;

  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.surface = new Surface(canvas);
  }

  clear() {
    this.#moment = null;
    this.surface.clear();
  }

  /**
   * @param {number} x CSS pixels from the left edge
   * @returns {number | null} the pulse that is drawn there; null: none, or it is yet to come
   */
  pulseAt(x) {
    if (!this.#moment) return null;
    const { end, frames } = this.#moment;
    const pulse = Math.round(end - frames + (x / this.surface.width) * (1 + AHEAD) * frames);
    return pulse < end ? pulse : null;
  }

  /** @param {Moment} moment */
  draw({ pulse, live, fps, seconds, decided, views, palette }) {
    const context = this.surface.clear();
    const { width, height } = this.surface;
    // The band stands at the newest; what is watched of the past is a mark on it.
    const end = live ? pulse : Math.max(pulse, decided);
    const frames = seconds * fps;
    this.#moment = { end, frames };
    const from = end - frames;
    const perFrame = width / ((1 + AHEAD) * frames);
    /** @param {number} at */
    const x = (at) => (at - from) * perFrame;
    for (const run of views(from)) {
      const left = x(run.first);
      const right = Math.max(Math.min(x(run.end), width) - GAP, left + LEAST);
      context.fillStyle = palette.colour(run.camera);
      context.fillRect(left, 0, right - left, height);
      writeName(context, run.camera, left, right, height);
    }
    shadeUndone(context, x(end), width, height);
    if (!live) mark(context, x(pulse), height);
  }
}

/**
 * The name in the band, where it fits: nobody has to tell colours apart.
 *
 * @param {CanvasRenderingContext2D} context
 * @param {string} camera
 * @param {number} left
 * @param {number} right
 * @param {number} height
 */
function writeName(context, camera, left, right, height) {
  context.font = LETTERS;
  if (context.measureText(camera).width + 10 > right - left) return;
  context.textBaseline = 'middle';
  context.fillStyle = 'rgba(0, 0, 0, 0.8)';
  context.fillText(camera, left + 5, height / 2 + 0.5);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number} now where what is decided and not yet shown begins
 * @param {number} width
 * @param {number} height
 */
function shadeUndone(context, now, width, height) {
  context.fillStyle = `rgba(16, 17, 18, ${1 - DECIDED_ALPHA})`;
  context.fillRect(now, 0, width - now, height);
  mark(context, now, height);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number} at
 * @param {number} height
 */
function mark(context, at, height) {
  context.fillStyle = '#101112';
  context.fillRect(at - 2, 0, 4, height);
  context.fillStyle = '#fff';
  context.fillRect(at - 1, 0, 2, height);
}
