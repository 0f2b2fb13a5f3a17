/**
 * A picture on which points are marked by a press or by keys: arrow keys move a cross, Enter marks a point.
 * Points are in pixels of the site's picture.
 */

import { svg } from '../../shared/dom.js';

/** @import {Site} from '../../shared/api_types.js' */
/** @import {Point} from './camera_pixels.js' */

/** @typedef {{point: Point, label: string, isWrong: boolean}} MarkedPoint */

const STEP = 1; // pixels that an arrow key moves the cross
const LARGE_STEP = 10; // with shift
const CROSS = 1 / 40; // of the picture's width
/** @type {Record<string, Point>} */
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class MarkingStage {
  /** @type {Point} */
  #cross;
  /** @type {Element[]} */
  #marks = [];

  /**
   * @param {HTMLElement} stage
   * @param {HTMLElement} drawing an svg element over the picture
   * @param {Site} site
   * @param {(point: Point) => void} mark
   * @param {() => void} undo
   */
  constructor(stage, drawing, site, mark, undo) {
    this.stage = stage;
    this.drawing = drawing;
    this.site = site;
    this.mark = mark;
    this.undo = undo;
    this.#cross = [site.width / 2, site.height / 2];
    drawing.setAttribute('viewBox', `0 0 ${site.width} ${site.height}`);
    stage.addEventListener('click', (event) => this.#press(event));
    stage.addEventListener('keydown', (event) => this.#handleKey(event));
  }

  /** @param {Point[][]} areas */
  drawAreas(areas) {
    this.#marks = areas.map((corners) => svg('polygon', { points: corners.join(' '), class: 'area' }));
    this.#draw();
  }

  /** @param {MarkedPoint[]} points */
  drawPoints(points) {
    const size = this.site.width * CROSS;
    this.#marks = points.flatMap(({ point: [x, y], label, isWrong }) => {
      const text = svg('text', { x: x + size / 3, y: y - size / 3, 'font-size': size });
      text.textContent = label;
      return [svg('circle', { cx: x, cy: y, r: size / 4, class: isWrong ? 'point wrong' : 'point' }), text];
    });
    this.#draw();
  }

  /** @param {MouseEvent} event */
  #press({ clientX, clientY }) {
    const { left, top, width, height } = this.stage.getBoundingClientRect();
    this.#cross = [((clientX - left) / width) * this.site.width, ((clientY - top) / height) * this.site.height];
    this.mark(this.#cross);
  }

  /** @param {KeyboardEvent} event */
  #handleKey(event) {
    const arrow = ARROWS[event.key];
    if (arrow) {
      const step = event.shiftKey ? LARGE_STEP : STEP;
      const [x, y] = this.#cross;
      this.#cross = [clamp(x + step * arrow[0], this.site.width), clamp(y + step * arrow[1], this.site.height)];
      this.#draw();
    } else if (event.key === 'Enter' || event.key === ' ') this.mark(this.#cross);
    else if (event.key === 'Backspace') this.undo();
    else return;
    event.preventDefault();
  }

  #draw() {
    const [x, y] = this.#cross;
    const size = this.site.width * CROSS;
    const cross = svg('path', { d: `M${x - size},${y}H${x + size}M${x},${y - size}V${y + size}`, class: 'cross' });
    this.drawing.replaceChildren(...this.#marks, cross);
  }
}

/**
 * @param {number} value
 * @param {number} max
 */
function clamp(value, max) {
  return Math.min(max, Math.max(0, value));
}
