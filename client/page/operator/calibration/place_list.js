/** The list of places on the floor: their positions, which are entered, and where cameras see them. */

import { element, make, setText } from '../../shared/dom.js';
import { describeCoordinate, toFloor } from './point_marks.js';

/** @import {PointsResult} from '../api_types.js' */
/** @import {Place, PointMarks} from './point_marks.js' */

/**
 * @typedef {object} PlaceListState
 * @property {string} unit of the floor
 * @property {Record<string, number[][]>} homographies present ones, by camera
 * @property {PointsResult['errors'] | null} errors of the last calibration, which is of these marks
 * @property {Set<number>} wrong numbers of places that an error names
 */

/** @typedef {{place: Place, item: HTMLElement, where: HTMLElement, proposals: HTMLElement[]}} Row */

export class PlaceList {
  #list = element('points-places');
  /** @type {Row[]} */
  #rows = [];

  /**
   * @param {PointMarks} marks
   * @param {() => void} changed called when a position was entered
   * @param {() => void} removed called when a place was removed, or its position taken from a calibration
   */
  constructor(marks, changed, removed) {
    this.marks = marks;
    this.changed = changed;
    this.removed = removed;
  }

  /** @param {PlaceListState} state */
  show(state) {
    this.#rows = this.marks.places.map((place, at) => this.#row(place, at + 1, state.homographies));
    this.#list.replaceChildren(...this.#rows.map(({ item }) => item));
    this.update(state);
  }

  /** @param {PlaceListState} state of the same places; fields keep their text and the focus */
  update({ unit, errors, wrong }) {
    this.#rows.forEach(({ place, item, where, proposals }, at) => {
      item.classList.toggle('wrong', wrong.has(at + 1));
      setText(where, `${unit} · ${this.#describe(place, unit, errors)}`);
      const hasPosition = place.position.some((text) => text.trim() !== '');
      for (const proposal of proposals) proposal.hidden = hasPosition;
    });
  }

  /**
   * @param {Place} place
   * @param {number} number
   * @param {Record<string, number[][]>} homographies
   * @returns {Row}
   */
  #row(place, number, homographies) {
    const fields = ['x', 'y'].map((axis, side) => {
      const field = make('input', { type: 'text', inputMode: 'decimal', autocomplete: 'off', value: place.position[side], size: 8 });
      field.ariaLabel = `Place ${number}, ${axis} on the floor`;
      field.setCustomValidity(describeCoordinate(field.value));
      field.addEventListener('input', () => {
        place.position[side] = field.value;
        field.setCustomValidity(describeCoordinate(field.value));
        this.changed();
      });
      return make('label', {}, `${axis} `, field);
    });
    const where = make('span', { className: 'quiet' });
    const proposals = this.#proposals(place, number, homographies);
    const remove = make('button', { type: 'button', textContent: 'Remove', ariaLabel: `Remove place ${number}` });
    remove.addEventListener('click', () => {
      this.marks.remove(place);
      this.removed();
      element('points-stage').focus({ preventScroll: true });
    });
    const item = make('li', {}, make('span', { className: 'place-number', textContent: String(number) }), ...fields, where, ...proposals, remove);
    return { place, item, where, proposals };
  }

  /**
   * @param {Place} place
   * @param {string} unit
   * @param {PlaceListState['errors']} errors
   */
  #describe(place, unit, errors) {
    const parts = [...place.seen].map(([camera, [x, y]]) => {
      const error = errors?.[camera]?.[this.marks.seenBy(camera).indexOf(place)];
      const off = error ? `, off by ${error.floor.toPrecision(2)} ${unit}, ${error.image.toFixed(1)} pixels` : '';
      return `${camera} at ${x}, ${y}${off}`;
    });
    return parts.join(' · ') || 'not marked in any picture';
  }

  /**
   * @param {Place} place
   * @param {number} number
   * @param {Record<string, number[][]>} homographies
   * @returns {HTMLButtonElement[]} that take over the position that a camera's present calibration has for it
   */
  #proposals(place, number, homographies) {
    return [...place.seen].flatMap(([camera, point]) => {
      const floor = homographies[camera] && toFloor(homographies[camera], point);
      if (!floor) return [];
      const take = make('button', { type: 'button', textContent: `${floor.join(', ')} as ${camera} is calibrated` });
      take.ariaLabel = `Place ${number}: ${take.textContent}`;
      take.addEventListener('click', () => {
        place.position = [String(floor[0]), String(floor[1])];
        this.removed();
        this.#rows[number - 1].item.querySelector('input')?.focus();
      });
      return [take];
    });
  }
}
