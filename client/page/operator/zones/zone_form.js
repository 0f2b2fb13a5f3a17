/** The form of one zone: its name, the coordinates of its corners as numbers, and its rules. */

import { element, make } from '../../shared/dom.js';
import { RuleList } from './rule_list.js';
import { addCorner, moveCorner, turnDirection } from './zone_shapes.js';

/** @import {SiteZone, ZoneRule} from '../api_types.js' */
/** @import {Place, Point, Shape} from './zone_shapes.js' */

const MIN_CORNERS = 3;

/**
 * @typedef {object} FormActions
 * @property {(zone: SiteZone) => void} save
 * @property {(rules: ZoneRule[]) => void} saveSiteRules
 * @property {() => void} remove
 * @property {() => void} cancel
 * @property {() => void} changed called when the shape has changed
 */

export class ZoneForm {
  /** @type {Shape | null} */
  shape = null;
  /** @type {Place | null} */
  #place = null;
  #isNew = true;
  /** Whether something was drawn or entered since it was opened. */
  isChanged = false;
  #rules;
  /** @type {HTMLFormElement} */
  #form = element('zone-form');
  /** @type {HTMLInputElement} */
  #name = element('zone-name');

  /**
   * @param {string[]} cameras of the site
   * @param {FormActions} actions
   */
  constructor(cameras, actions) {
    this.actions = actions;
    this.#rules = new RuleList(cameras);
    this.#form.addEventListener('submit', (event) => {
      event.preventDefault();
      if (this.shape && this.#place) actions.save(this.#read(this.shape, this.#place));
      else actions.saveSiteRules(this.#rules.read('site'));
    });
    this.#form.addEventListener('input', () => (this.isChanged = true));
    element('zone-remove').addEventListener('click', actions.remove);
    element('zone-cancel').addEventListener('click', actions.cancel);
    element('zone-add-corner').addEventListener('click', () => this.press(this.#suggestCorner()));
    element('zone-turn').addEventListener('click', () => this.#change(turnDirection));
  }

  /**
   * @param {SiteZone} zone its name is empty if it is new
   * @param {Shape} shape
   * @param {Place} place
   * @param {string[]} taken names of the rules that are not on it
   */
  open(zone, shape, place, taken) {
    this.shape = shape;
    this.#place = place;
    this.#isNew = zone.zone === '';
    this.#name.value = zone.zone;
    this.#rules.set(zone.rules, shape.kind, zone.camera, taken);
    this.#showFields(true);
    element('zone-x').textContent = ['x', place.unit].filter(Boolean).join(', ');
    element('zone-y').textContent = ['y', place.unit].filter(Boolean).join(', ');
    element('zone-remove').hidden = this.#isNew;
    element('zone-turn').hidden = shape.kind === 'area';
    this.#form.hidden = this.isChanged = false;
    this.#showCorners();
  }

  /**
   * Open the rules that are on no zone.
   *
   * @param {ZoneRule[]} rules
   * @param {string[]} taken names of the other rules
   */
  openSiteRules(rules, taken) {
    this.shape = this.#place = null;
    this.#rules.set(rules, null, null, taken);
    this.#showFields(false);
    element('zone-remove').hidden = true;
    this.#form.hidden = this.isChanged = false;
  }

  /** @param {boolean} isZone else there is no name and no shape */
  #showFields(isZone) {
    element('zone-shape').hidden = !isZone;
    this.#name.disabled = !isZone;
  }

  /**
   * @param {string} message of the server
   * @returns {boolean} whether it is shown at the rule that it names
   */
  showRefusal(message) {
    return this.#rules.showRefusal(message);
  }

  close() {
    this.shape = this.#place = null;
    this.#form.hidden = true;
    this.isChanged = false;
  }

  /** @param {Point} point pressed in the drawing */
  press(point) {
    this.#change((shape) => addCorner(shape, point, this.#isNew));
  }

  /**
   * @param {number} index -1: the inner point of a line
   * @param {Point} point
   */
  move(index, point) {
    this.#change((shape) => moveCorner(shape, index, point));
  }

  /** @param {(shape: Shape) => void} change */
  #change(change) {
    if (!this.shape) return;
    change(this.shape);
    this.isChanged = true;
    this.#showCorners();
    this.actions.changed();
  }

  /** @returns {Point} between the last corner and the first, or the center of the drawing */
  #suggestCorner() {
    const corners = this.shape?.corners ?? [];
    const center = this.#place?.center ?? [0, 0];
    if (corners.length < MIN_CORNERS) return center;
    const [[x, y], [x2, y2]] = [corners[0], corners[corners.length - 1]];
    return [(x + x2) / 2, (y + y2) / 2];
  }

  #showCorners() {
    if (!this.shape) return;
    const { kind, corners, inner } = this.shape;
    element('zone-add-corner').hidden = kind === 'line' && corners.length === 2;
    const rows = corners.map((corner, at) => this.#row(kind === 'line' ? `End ${at + 1}` : String(at + 1), corner, at));
    if (inner) rows.push(this.#row('Inner side', inner, -1));
    const body = element('zone-corners');
    while (body.children.length > rows.length) body.lastChild?.remove();
    rows.forEach((row, at) => keepFocus(body, body.children[at], row));
  }

  /**
   * @param {string} name
   * @param {Point} corner
   * @param {number} index
   */
  #row(name, corner, index) {
    const fields = ['x', 'y'].map((axis, side) => {
      const field = make('input', { type: 'number', step: 'any', value: String(corner[side]), required: true });
      field.ariaLabel = `${/^\d/.test(name) ? `Corner ${name}` : name}, ${axis}`;
      field.addEventListener('input', () => {
        if (!Number.isFinite(field.valueAsNumber) || !this.shape) return;
        const [x, y] = index < 0 ? this.shape.inner ?? corner : this.shape.corners[index];
        this.move(index, side === 0 ? [field.valueAsNumber, y] : [x, field.valueAsNumber]);
      });
      return make('td', {}, field);
    });
    const remove = make('button', { type: 'button', textContent: 'Remove', ariaLabel: `Remove corner ${name}` });
    remove.hidden = this.shape?.kind === 'line';
    remove.addEventListener('click', () => {
      this.#change(({ corners }) => void corners.splice(index, 1));
      element('zone-add-corner').focus();
    });
    return make('tr', {}, make('th', { scope: 'row', textContent: name }), ...fields, make('td', {}, remove));
  }

  /**
   * @param {Shape} shape
   * @param {Place} place
   * @returns {SiteZone}
   */
  #read({ kind, corners, inner }, { camera }) {
    const zone = this.#name.value.trim();
    const [area, line] = kind === 'area' ? [corners, null] : [null, corners];
    return { zone, camera, area, line, inner, rules: this.#rules.read(zone) };
  }
}

/**
 * Put a row in the place of another one, whose field keeps the focus and its text if it has the focus.
 *
 * @param {Element} body
 * @param {Element | undefined} old
 * @param {Element} row
 */
function keepFocus(body, old, row) {
  const focused = old ? [...old.querySelectorAll('input')].indexOf(/** @type {HTMLInputElement} */ (document.activeElement)) : -1;
  if (!old) return body.append(row);
  if (focused < 0) return old.replaceWith(row);
  const [fields, others] = [[...old.querySelectorAll('input')], [...row.querySelectorAll('input')]];
  fields.forEach((field, at) => {
    if (at !== focused) field.value = others[at].value;
  });
}
