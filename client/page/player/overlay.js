/** A frame, or a part of it, and its boxes: the chosen person in the accent, the others thin and neutral. */

import { label } from '../people/names.js';
import { Surface } from './surface.js';

/** @import {Box} from '../shared/contract.js' */
/** @import {Part, Size} from './viewport_follow.js' */

const ACCENT = '#3fdc7f';
const NEUTRAL = 'rgba(255, 255, 255, 0.75)';
const SHADE = 'rgba(0, 0, 0, 0.55)'; // under every line: boxes must be seen on white walls too
const CHOSEN_WIDTH = 2.5;
const OTHER_WIDTH = 1;
const FONT = '600 12px system-ui, sans-serif';
const LABEL_HEIGHT = 17;

export class Overlay {
  /** @type {Part | null} what was drawn last; null: the whole picture */
  #part = null;

  /**
   * @param {HTMLCanvasElement} canvas lies exactly over the video element
   */
  constructor(canvas) {
    this.surface = new Surface(canvas);
  }

  clear() {
    this.#part = null;
    this.surface.clear();
  }

  /**
   * @param {Box[]} boxes of the camera and the frame now shown
   * @param {number | null} chosen
   * @param {Size} picture pixels that the boxes are measured in
   * @param {VideoFrame | null} image the frame; null leaves the view of the video element below
   * @param {Part | null} part of the picture that is to fill the canvas; null: all of it
   */
  draw(boxes, chosen, picture, image, part) {
    this.#part = part;
    const context = this.surface.clear();
    const { scale, left, top } = this.#place(picture);
    context.translate(left, top);
    if (image) context.drawImage(image, 0, 0, picture.width * scale, picture.height * scale);
    const [mine, others] = [true, false].map((is) => boxes.filter(([object]) => (object === chosen) === is));
    for (const box of others) drawBox(context, box, scale, false);
    for (const box of mine) drawBox(context, box, scale, true); // last: on top
  }

  /**
   * @param {Box[]} boxes
   * @param {Size} picture
   * @param {{offsetX: number, offsetY: number}} point CSS pixels from the canvas's corner
   * @returns {number | null} the smallest box's object at that point: who stands in front of a crowd
   */
  hit(boxes, picture, { offsetX, offsetY }) {
    const { x, y } = this.inPicture(offsetX, offsetY, picture);
    const under = boxes.filter(([, l, t, r, b]) => l <= x && x < r && t <= y && y < b);
    under.sort((a, b) => area(a) - area(b));
    return under.length ? under[0][0] : null;
  }

  /**
   * @param {number} x CSS pixels from the canvas's corner
   * @param {number} y
   * @param {Size} picture
   * @returns {{x: number, y: number, scale: number}} that place in the picture, and CSS pixels for each of its pixels
   */
  inPicture(x, y, picture) {
    const { scale, left, top } = this.#place(picture);
    return { x: (x - left) / scale, y: (y - top) / scale, scale };
  }

  /**
   * @param {number} x pixels of the picture
   * @param {number} y
   * @param {Size} picture
   * @returns {{x: number, y: number}} that place in the canvas, CSS pixels from its corner
   */
  onScreen(x, y, picture) {
    const { scale, left, top } = this.#place(picture);
    return { x: left + x * scale, y: top + y * scale };
  }

  /**
   * @param {Size} picture
   * @returns {string} what makes the video element below show the part that was drawn last (CSS)
   */
  transform(picture) {
    if (!this.#part) return 'none';
    const [before, after] = [this.#place(picture, null), this.#place(picture)];
    const larger = after.scale / before.scale;
    const [x, y] = [after.left - larger * before.left, after.top - larger * before.top];
    return `translate(${x}px, ${y}px) scale(${larger})`;
  }

  /**
   * Where the picture lies in the canvas: the part as large as fits, in the middle.
   *
   * @param {Size} picture
   */
  #place(picture, part = this.#part) {
    const { width, height } = this.surface;
    const shown = part ?? { left: 0, top: 0, ...picture };
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
 * @param {boolean} chosen
 */
function drawBox(context, [object, left, top, right, bottom], scale, chosen) {
  const [x, y] = [left * scale, top * scale];
  const [width, height] = [(right - left) * scale, (bottom - top) * scale];
  const line = chosen ? CHOSEN_WIDTH : OTHER_WIDTH;
  context.lineWidth = line + 2;
  context.strokeStyle = SHADE;
  context.strokeRect(x, y, width, height);
  context.lineWidth = line;
  context.strokeStyle = chosen ? ACCENT : NEUTRAL;
  context.strokeRect(x, y, width, height);
  drawNumber(context, label(object), x, y, chosen);
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {string} text
 * @param {number} x
 * @param {number} y of the box's top
 * @param {boolean} chosen
 */
function drawNumber(context, text, x, y, chosen) {
  context.font = FONT;
  context.textBaseline = 'middle';
  const width = context.measureText(text).width + 9;
  const top = y >= LABEL_HEIGHT ? y - LABEL_HEIGHT : y; // inside where there is no room above
  context.fillStyle = chosen ? ACCENT : SHADE;
  context.fillRect(x - 1, top, width, LABEL_HEIGHT);
  context.fillStyle = chosen ? '#06240f' : '#fff';
  context.fillText(text, x + 3.5, top + LABEL_HEIGHT / 2 + 1);
}
