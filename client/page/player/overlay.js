/** Draws a frame, or its viewport, with its boxes: the selected person in the accent color, others thin and neutral. */

import { shortLabel } from '../people/names.js';
import { Surface } from './surface.js';

/** @import {Box} from '../shared/api_types.js' */
/** @import {Size, Viewport} from './viewport.js' */

const ACCENT = '#3fdc7f';
const NEUTRAL = 'rgba(255, 255, 255, 0.75)';
const SHADE = 'rgba(0, 0, 0, 0.55)'; // under every line, so that boxes are visible on white walls
const SELECTED_WIDTH = 2.5;
const OTHER_WIDTH = 1;
const FONT = '600 12px system-ui, sans-serif';
const LABEL_HEIGHT = 17;

export class Overlay {
  /** @type {Viewport | null} drawn last; null: the whole picture */
  #viewport = null;

  /**
   * @param {HTMLCanvasElement} canvas exactly over the video element
   */
  constructor(canvas) {
    this.surface = new Surface(canvas);
  }

  clear() {
    this.#viewport = null;
    this.surface.clear();
  }

  /**
   * @param {Box[]} boxes of the displayed frame
   * @param {number | null} selected number of the person
   * @param {Size} picture pixels that the boxes are measured in
   * @param {VideoFrame | null} image the frame; null: leave the canvas transparent over the video element
   * @param {Viewport | null} viewport that fills the canvas; null: the whole picture
   */
  draw(boxes, selected, picture, image, viewport) {
    this.#viewport = viewport;
    const context = this.surface.clear();
    const { scale, left, top } = this.#place(picture);
    context.translate(left, top);
    if (image) context.drawImage(image, 0, 0, picture.width * scale, picture.height * scale);
    for (const onTop of [false, true]) {
      for (const box of boxes) if ((box[0] === selected) === onTop) drawBox(context, box, scale, onTop);
    }
  }

  /**
   * @param {Box[]} boxes
   * @param {Size} picture
   * @param {{offsetX: number, offsetY: number}} point CSS pixels from the canvas's corner
   * @returns {number | null} object of the smallest box at that point
   */
  hit(boxes, picture, { offsetX, offsetY }) {
    const { x, y } = this.toPicture(offsetX, offsetY, picture);
    const hits = boxes.filter(([, left, top, right, bottom]) => left <= x && x < right && top <= y && y < bottom);
    hits.sort((a, b) => area(a) - area(b));
    return hits.length ? hits[0][0] : null;
  }

  /**
   * @param {number} x CSS pixels from the canvas's corner
   * @param {number} y
   * @param {Size} picture
   * @returns {{x: number, y: number, scale: number}} the point in the picture, and CSS pixels per pixel of the picture
   */
  toPicture(x, y, picture) {
    const { scale, left, top } = this.#place(picture);
    return { x: (x - left) / scale, y: (y - top) / scale, scale };
  }

  /**
   * @param {number} x pixels of the picture
   * @param {number} y
   * @param {Size} picture
   * @returns {{x: number, y: number}} the point on the canvas, CSS pixels from its corner
   */
  toCanvas(x, y, picture) {
    const { scale, left, top } = this.#place(picture);
    return { x: left + x * scale, y: top + y * scale };
  }

  /**
   * @param {Size} picture
   * @returns {string} CSS transform that makes the video element below show the viewport drawn last
   */
  transform(picture) {
    if (!this.#viewport) return 'none';
    const [before, after] = [this.#place(picture, null), this.#place(picture)];
    const zoom = after.scale / before.scale;
    const [x, y] = [after.left - zoom * before.left, after.top - zoom * before.top];
    return `translate(${x}px, ${y}px) scale(${zoom})`;
  }

  /**
   * Return where the picture lies on the canvas: the viewport centered, as large as fits.
   *
   * @param {Size} picture
   */
  #place(picture, viewport = this.#viewport) {
    const { width, height } = this.surface;
    const shown = viewport ?? { left: 0, top: 0, ...picture };
    const scale = Math.min(width / shown.width, height / shown.height);
    const left = (width - shown.width * scale) / 2 - shown.left * scale;
    return { scale, left, top: (height - shown.height * scale) / 2 - shown.top * scale };
  }
}

/** @param {Box} box */
function area([, left, top, right, bottom]) {
  return (right - left) * (bottom - top);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {Box} box
 * @param {number} scale CSS pixels per pixel of the picture
 * @param {boolean} selected
 */
function drawBox(context, [object, left, top, right, bottom], scale, selected) {
  const [x, y] = [left * scale, top * scale];
  const [width, height] = [(right - left) * scale, (bottom - top) * scale];
  const line = selected ? SELECTED_WIDTH : OTHER_WIDTH;
  context.lineWidth = line + 2;
  context.strokeStyle = SHADE;
  context.strokeRect(x, y, width, height);
  context.lineWidth = line;
  context.strokeStyle = selected ? ACCENT : NEUTRAL;
  context.strokeRect(x, y, width, height);
  drawNumber(context, shortLabel(object), x, y, selected);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {string} text
 * @param {number} x
 * @param {number} y of the box's top
 * @param {boolean} selected
 */
function drawNumber(context, text, x, y, selected) {
  context.font = FONT;
  context.textBaseline = 'middle';
  const width = context.measureText(text).width + 9;
  const top = y >= LABEL_HEIGHT ? y - LABEL_HEIGHT : y; // inside the box if there is no room above
  context.fillStyle = selected ? ACCENT : SHADE;
  context.fillRect(x - 1, top, width, LABEL_HEIGHT);
  context.fillStyle = selected ? '#06240f' : '#fff';
  context.fillText(text, x + 3.5, top + LABEL_HEIGHT / 2 + 1);
}
