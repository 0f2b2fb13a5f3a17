/**
 * Pointing: the operator's pointer (mouse, finger, pen, eye tracker) marks a person's position frame by frame.
 *
 * While it is on, every displayed frame yields a position correction as long as the pointer is over the picture, or
 * the finger is down. A press adds one more. Arrow keys move the cross, and Enter counts as a press.
 */

import { HttpError, requestOperator } from '../../shared/requests.js';

/** @import {Overlay} from '../../player/overlay.js' */
/** @import {Viewer} from '../../viewer.js' */

const SEND_MS = 100;
const TOLERANCE = { touch: 24, other: 12 }; // CSS pixels
const STEP = 8; // CSS pixels that an arrow key moves the cross; four times as far with shift
const MAX_QUEUED = 250; // corrections; after a failure of the server only the newest are sent
/** @type {Record<string, [number, number]>} */
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** @typedef {{x: number, y: number, tolerance: number}} StagePoint CSS pixels from the corner of the stage */

/**
 * @typedef {object} Correction
 * @property {number} pulse
 * @property {number} x pixels of the site's picture
 * @property {number} y
 * @property {number} tolerance maximum error, pixels
 *
 * @typedef {object} CorrectionBatch
 * @property {number} object
 * @property {string} camera
 * @property {Correction[]} corrections
 */

export class Pointing {
  /** @type {number | null} the person pointed at; null: off */
  object = null;
  /** Whether the visitor may point, and the site's cameras use corrections. */
  available = false;
  /** Corrections accepted by the server. */
  accepted = 0;
  /** @type {StagePoint | null} null: the pointer is not over the picture */
  #pointer = null;
  #queue = new CorrectionQueue();
  #sending = false;

  /**
   * @param {HTMLElement} stage
   * @param {HTMLElement} cross
   * @param {Viewer} viewer
   * @param {Overlay} overlay
   * @param {(error: unknown) => void} showError null: no error
   */
  constructor(stage, cross, viewer, overlay, showError) {
    this.stage = stage;
    this.cross = cross;
    this.viewer = viewer;
    this.overlay = overlay;
    this.showError = showError;
    stage.addEventListener('pointermove', (event) => this.#move(event, event.pointerType === 'touch' && !event.buttons));
    stage.addEventListener('pointerdown', (event) => this.#press(event));
    stage.addEventListener('pointerleave', () => this.#setPointer(null));
    for (const name of ['pointerup', 'pointercancel']) {
      stage.addEventListener(name, (event) => {
        if (/** @type {PointerEvent} */ (event).pointerType === 'touch') this.#setPointer(null);
      });
    }
    document.addEventListener('keydown', (event) => this.#handleKey(event), { capture: true });
    setInterval(() => void this.#send(), SEND_MS);
  }

  /** Ask the server whether corrections are available. */
  async updateAvailability() {
    const request = requestOperator('position_corrections');
    this.available = await request.then(({ unavailable }) => unavailable === '', () => false);
    if (!this.available) this.end();
  }

  /** @param {number} object the person to point at */
  begin(object) {
    if (!this.available) return;
    this.object = object;
    this.stage.classList.add('pointing');
  }

  end() {
    this.object = null;
    this.stage.classList.remove('pointing');
    this.#setPointer(null);
  }

  /** A frame is displayed: the person is at the pointer in it. */
  addFrame() {
    if (this.#pointer) this.#addCorrection(this.#pointer);
  }

  /**
   * @param {PointerEvent} event
   * @param {boolean} [left] whether the pointer is no longer over the picture
   */
  #move({ clientX, clientY, pointerType }, left = false) {
    if (this.object === null) return;
    const stage = this.stage.getBoundingClientRect();
    const tolerance = pointerType === 'touch' ? TOLERANCE.touch : TOLERANCE.other;
    this.#setPointer(left ? null : { x: clientX - stage.left, y: clientY - stage.top, tolerance });
  }

  /** @param {PointerEvent} event */
  #press(event) {
    if (this.object === null || (event.target instanceof Element && event.target.closest('button'))) return;
    this.#move(event);
    if (this.#pointer) this.#addCorrection(this.#pointer);
  }

  /** @param {KeyboardEvent} event */
  #handleKey(event) {
    const { key, shiftKey, target } = event;
    if (this.object === null || event.ctrlKey || event.metaKey || event.altKey) return;
    const onControl = target instanceof Element && target.closest('button, a, summary, select, input');
    if (key in ARROWS) {
      const [x, y] = ARROWS[key].map((direction) => direction * STEP * (shiftKey ? 4 : 1));
      const from = this.#pointer ?? this.#initialPointer();
      const { width, height } = this.stage.getBoundingClientRect();
      this.#setPointer({ x: clamp(from.x + x, width), y: clamp(from.y + y, height), tolerance: TOLERANCE.other });
    } else if (key === 'Enter' && !onControl && this.#pointer) this.#addCorrection(this.#pointer);
    else if (key === 'Escape') this.end();
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  /** @returns {StagePoint} the center of the person's box, or of the stage */
  #initialPointer() {
    const { site, currentFrame } = this.viewer;
    const { width, height } = this.stage.getBoundingClientRect();
    const box = currentFrame.boxes.find(([object]) => object === this.object);
    if (!site || !box) return { x: width / 2, y: height / 2, tolerance: TOLERANCE.other };
    const [, left, top, right, bottom] = box;
    return { ...this.overlay.toCanvas((left + right) / 2, (top + bottom) / 2, site), tolerance: TOLERANCE.other };
  }

  /** @param {StagePoint | null} point */
  #setPointer(point) {
    this.#pointer = point;
    this.cross.hidden = point === null;
    if (point) this.cross.style.transform = `translate(${point.x}px, ${point.y}px)`;
  }

  /** @param {StagePoint} point in the displayed frame */
  #addCorrection({ x, y, tolerance }) {
    const { site, probe, currentFrame, player } = this.viewer;
    if (this.object === null || !site || !currentFrame.mapped || player.isSwitching(currentFrame.mediaTime)) return;
    if (probe.pulse === null || probe.camera === null) return;
    const { scale, ...point } = this.overlay.toPicture(x, y, site);
    if (!(point.x >= 0 && point.x <= site.width && point.y >= 0 && point.y <= site.height)) return;
    this.#queue.add(this.object, probe.camera, { pulse: probe.pulse, ...point, tolerance: tolerance / scale });
  }

  async #send() {
    if (this.#sending) return;
    this.#sending = true;
    try {
      for (let batch = this.#queue.take(); batch; batch = this.#queue.take()) {
        const { accepted } = await requestOperator('position_corrections', 'POST', batch);
        this.accepted += accepted;
        this.showError(null);
      }
    } catch (error) {
      this.showError(error);
      if (error instanceof HttpError && [401, 403].includes(error.status)) this.available = false;
    } finally {
      this.#sending = false;
    }
  }
}

/** Corrections to be sent, in batches of one person and camera. */
export class CorrectionQueue {
  /** @type {{object: number, camera: string, correction: Correction}[]} in order */
  #queue = [];

  /**
   * Add a correction; it replaces an earlier one of the same frame.
   *
   * @param {number} object
   * @param {string} camera
   * @param {Correction} correction
   */
  add(object, camera, correction) {
    const last = this.#queue.at(-1);
    const sameFrame = last?.correction.pulse === correction.pulse && last.camera === camera && last.object === object;
    if (sameFrame) this.#queue.pop();
    this.#queue.push({ object, camera, correction });
    if (this.#queue.length > MAX_QUEUED) this.#queue.shift();
  }

  /** @returns {CorrectionBatch | null} the oldest batch; null: the queue is empty */
  take() {
    const [first] = this.#queue;
    if (!first) return null;
    const { object, camera } = first;
    const end = this.#queue.findIndex((entry) => entry.object !== object || entry.camera !== camera);
    const entries = this.#queue.splice(0, end < 0 ? this.#queue.length : end);
    return { object, camera, corrections: entries.map(({ correction }) => correction) };
  }
}

/**
 * @param {number} value
 * @param {number} max
 */
function clamp(value, max) {
  return Math.min(Math.max(value, 0), max);
}
