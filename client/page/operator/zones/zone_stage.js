/** The drawing of zones on the floor plan or in a camera's picture; corners of one zone are moved by dragging. */

import { svg } from '../../shared/dom.js';

/** @import {SiteZone} from '../api_types.js' */
/** @import {Place, Point, Shape} from './zone_shapes.js' */

const NAME_SIZE = 0.035; // share of the drawing's size
const INNER = -1; // index of the inner point of a line

/**
 * @typedef {object} StageActions
 * @property {(point: Point) => void} press where the drawing was pressed, in coordinates of zones
 * @property {(index: number, point: Point) => void} move a corner; -1 is the inner point of a line
 * @property {(zone: string) => void} choose a zone that was pressed
 */

export class ZoneStage {
  /** @type {number | null} index of the corner that is being dragged */
  #dragged = null;
  #wasDragged = false; // the next click is the end of dragging
  /** @type {Place | null} */
  #place = null;
  #background = svg('g');
  #zones = svg('g');
  #people = svg('g');
  #selected = svg('g');

  /**
   * @param {HTMLElement} drawing an svg element
   * @param {StageActions} actions
   */
  constructor(drawing, actions) {
    this.drawing = /** @type {SVGSVGElement} */ (/** @type {Element} */ (drawing));
    this.actions = actions;
    this.drawing.append(this.#background, this.#zones, this.#people, this.#selected);
    drawing.addEventListener('pointerdown', (event) => this.#grasp(event));
    drawing.addEventListener('pointermove', (event) => this.#drag(event));
    for (const end of ['pointerup', 'pointercancel']) drawing.addEventListener(end, () => (this.#dragged = null));
    drawing.addEventListener('click', (event) => this.#press(event));
  }

  /**
   * @param {Place | null} place null: nothing can be drawn
   * @param {string} viewBox
   * @param {Element[]} background
   */
  show(place, viewBox, background) {
    this.#place = place;
    if (viewBox) this.drawing.setAttribute('viewBox', viewBox);
    this.#background.replaceChildren(...background);
    this.#people.replaceChildren();
  }

  /** @param {Element[]} people */
  drawPeople(people) {
    this.#people.replaceChildren(...people);
  }

  /**
   * @param {SiteZone[]} zones on this place, without the selected one
   * @param {Shape | null} selected
   */
  draw(zones, selected) {
    const place = this.#place;
    this.#zones.replaceChildren(...(place ? zones.flatMap((zone) => drawZone(zone, place)) : []));
    this.#selected.replaceChildren(...(place && selected ? drawSelected(selected, place) : []));
  }

  /** @param {PointerEvent} event */
  #grasp(event) {
    const corner = /** @type {SVGElement} */ (event.target).dataset.corner;
    this.#wasDragged = corner !== undefined;
    if (corner === undefined || event.button !== 0) return;
    this.#dragged = Number(corner);
    this.drawing.setPointerCapture(event.pointerId); // its corner is drawn anew meanwhile
    event.preventDefault();
  }

  /** @param {PointerEvent} event */
  #drag(event) {
    if (this.#dragged === null || !this.#place) return;
    this.actions.move(this.#dragged, this.#place.fromDrawing(this.#pointOf(event)));
  }

  /** @param {MouseEvent} event */
  #press(event) {
    if (this.#wasDragged || !this.#place) return;
    const zone = /** @type {SVGElement} */ (event.target).dataset.zone;
    if (zone !== undefined) this.actions.choose(zone);
    else this.actions.press(this.#place.fromDrawing(this.#pointOf(event)));
  }

  /**
   * @param {MouseEvent} event
   * @returns {Point} in the drawing
   */
  #pointOf({ clientX, clientY }) {
    const matrix = this.drawing.getScreenCTM()?.inverse();
    const { x, y } = new DOMPoint(clientX, clientY).matrixTransform(matrix);
    return [x, y];
  }
}

/**
 * @param {SiteZone} zone
 * @param {Place} place
 */
function drawZone({ zone, area, line }, place) {
  const corners = (area ?? line ?? []).map(place.toDrawing);
  const mark = svg(area ? 'polygon' : 'polyline', { points: corners.join(' '), class: 'zone' });
  mark.dataset.zone = zone;
  return [mark, nameAt(zone, corners, place)];
}

/**
 * @param {string} text
 * @param {Point[]} corners
 * @param {Place} place
 */
function nameAt(text, corners, place) {
  const [x, y] = [0, 1].map((axis) => corners.reduce((sum, corner) => sum + corner[axis], 0) / corners.length);
  const name = svg('text', { x, y, 'font-size': place.size * NAME_SIZE, class: 'name' });
  name.textContent = text;
  return name;
}

/**
 * @param {Shape} shape
 * @param {Place} place
 */
function drawSelected({ kind, corners, inner }, place) {
  const points = corners.map(place.toDrawing);
  const marks = [svg(kind === 'area' ? 'polygon' : 'polyline', { points: points.join(' '), class: 'zone selected' })];
  if (inner && points.length === 2) {
    const end = place.toDrawing(inner);
    const middle = [0, 1].map((axis) => (points[0][axis] + points[1][axis]) / 2);
    marks.push(svg('polyline', { points: `${middle} ${end}`, class: 'zone direction' }), ...grip(end, INNER, 'in', place));
  }
  return [...marks, ...points.flatMap((point, at) => grip(point, at, String(at + 1), place))];
}

/**
 * A corner to drag. Lines of no length with round ends are dots that stay as large as they are on any scale.
 *
 * @param {Point} point
 * @param {number} corner
 * @param {string} text
 * @param {Place} place
 */
function grip([x, y], corner, text, place) {
  const d = `M${x},${y}h0`;
  const [around, dot] = [svg('path', { d, class: 'grip around' }), svg('path', { d, class: 'grip' })];
  around.dataset.corner = dot.dataset.corner = String(corner);
  const label = svg('text', { x: x + place.size / 60, y: y - place.size / 60, 'font-size': place.size * NAME_SIZE, class: 'label' });
  label.textContent = text;
  return [around, dot, label];
}
