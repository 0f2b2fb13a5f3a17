/** The rules on one zone, as rows of a form. */

import { element, make } from '../../shared/dom.js';
import { restrictionFields } from './rule_restrictions.js';

/** @import {ZoneRule} from '../api_types.js' */
/** @import {Shape} from './zone_shapes.js' */

/** @typedef {'entered' | 'left' | 'stayed' | 'crowded' | 'close' | 'crossed'} Kind */

/** @type {Record<Kind, string>} */
const KINDS = {
  entered: 'Someone enters',
  left: 'Someone leaves',
  stayed: 'Someone stays longer than',
  crowded: 'There are more people than',
  close: 'Two people are closer than',
  crossed: 'Someone crosses',
};
/**
 * @typedef {object} Limit of a kind
 * @property {'longer_than_s' | 'more_than' | 'closer_than_m'} key
 * @property {string} unit
 * @property {number} usual
 * @property {number} most
 * @property {boolean} isCount a whole number, or none; else above 0
 */

/** @type {Partial<Record<Kind, Limit>>} */
const LIMITS = {
  stayed: { key: 'longer_than_s', unit: 'seconds', usual: 60, most: 86_400, isCount: false },
  crowded: { key: 'more_than', unit: 'people', usual: 4, most: 10_000, isCount: true },
  close: { key: 'closer_than_m', unit: 'meters', usual: 1.5, most: 1e9, isCount: false },
};
const HELD = /** @type {string[]} */ (['crowded', 'close']); // kinds that must last
const HOLD_S = 1;
const MAX_HOLD_S = 3600;
const NAME = /^[A-Za-z0-9][A-Za-z0-9_-]{0,31}$/;
const DIRECTIONS = { '': 'either way', inward: 'inward', outward: 'outward' };

const NO_LIMITS = { direction: null, longer_than_s: null, more_than: null, closer_than_m: null, hold_s: null };

export class RuleList {
  /** @type {ZoneRule[]} */
  #rules = [];
  /** @type {Set<ZoneRule>} those that are not in the file yet, whose names can be chosen */
  #added = new Set();
  /** @type {Kind[]} that fit the zone */
  #kinds = [];
  /** @type {Set<string>} names of rules elsewhere */
  #taken = new Set();
  #list = element('zone-rules');

  /** @param {string[]} cameras of the site */
  constructor(cameras) {
    this.cameras = cameras;
    element('zone-add-rule').addEventListener('click', () => {
      /** @type {ZoneRule} */
      const rule = { rule: '', kind: this.#kinds[0], ...NO_LIMITS, people: [], days: null, hours: null, cameras: [] };
      this.#rules.push(rule);
      this.#added.add(rule);
      this.#show();
      this.#list.querySelectorAll('li')[this.#rules.length - 1].querySelector('select')?.focus();
    });
  }

  /**
   * @param {ZoneRule[]} rules
   * @param {Shape['kind'] | null} shape of the zone; null: they are on none
   * @param {string | null} camera of the zone
   * @param {string[]} taken names of rules elsewhere
   */
  set(rules, shape, camera, taken) {
    this.#rules = rules.map((rule) => ({ ...rule }));
    this.#taken = new Set(taken);
    this.#added.clear();
    const ofAreas = /** @type {Kind[]} */ (['entered', 'left', 'stayed', 'crowded', ...(camera === null ? ['close'] : [])]);
    this.#kinds = shape === 'line' ? ['crossed'] : ofAreas;
    this.#show();
  }

  /**
   * @param {string} zone its name, of which rules without one get theirs
   * @returns {ZoneRule[]}
   */
  read(zone) {
    const taken = new Set([...this.#taken, ...this.#rules.map(({ rule }) => rule)]);
    return this.#rules.map((rule) => {
      if (rule.rule) return rule;
      const name = freeName(`${zone.slice(0, 21)}-${rule.kind}`, taken);
      taken.add(name);
      return { ...rule, rule: name };
    });
  }

  /**
   * Show what the server refuses at the rule that it names.
   *
   * @param {string} message
   * @returns {boolean} whether it names one
   */
  showRefusal(message) {
    const [, number, what] = /^rule (\d+): (.*)$/.exec(message) ?? [];
    const item = number && this.#list.children[Number(number) - 1];
    if (!item) return false;
    item.append(make('p', { className: 'error-message', textContent: what, role: 'alert' }));
    item.querySelector('select')?.focus();
    return true;
  }

  #show() {
    this.#list.replaceChildren(...this.#rules.map((rule, at) => this.#row(rule, at + 1)));
  }

  /**
   * @param {ZoneRule} rule
   * @param {number} number
   */
  #row(rule, number) {
    const options = this.#kinds.map((kind) => make('option', { value: kind, textContent: KINDS[kind], selected: kind === rule.kind }));
    const kind = make('select', { ariaLabel: `Rule ${number}` }, ...options);
    kind.addEventListener('change', () => {
      Object.assign(rule, { kind: kind.value, ...NO_LIMITS });
      this.#show();
      this.#list.querySelectorAll('li')[number - 1].querySelector('select')?.focus();
    });
    const remove = make('button', { type: 'button', textContent: 'Remove', ariaLabel: `Remove rule ${number}` });
    remove.addEventListener('click', () => {
      this.#rules.splice(number - 1, 1);
      this.#show();
      element('zone-add-rule').focus();
    });
    return make('li', {}, kind, ...parameter(rule, number), ...duration(rule, number), ...this.#name(rule, number), remove, restrictionFields(rule, number, this.cameras));
  }

  /**
   * @param {ZoneRule} rule
   * @param {number} number
   */
  #name(rule, number) {
    if (!this.#added.has(rule)) return [make('span', { className: 'quiet', textContent: rule.rule })];
    const name = make('input', { value: rule.rule, size: 12, maxLength: 32, placeholder: 'its name', spellcheck: false });
    name.ariaLabel = `Name of rule ${number}; empty: after the zone`;
    name.addEventListener('input', () => {
      rule.rule = name.value.trim();
      name.setCustomValidity(this.#describeName(rule));
    });
    return [name];
  }

  /**
   * @param {ZoneRule} rule
   * @returns {string} what is wrong with its name; empty: nothing
   */
  #describeName(rule) {
    if (rule.rule && !NAME.test(rule.rule)) return 'Use letters, digits, _ and -, at most 32.';
    const isTaken = this.#taken.has(rule.rule) || this.#rules.some((other) => other !== rule && other.rule && other.rule === rule.rule);
    return isTaken ? `Another rule is called ${rule.rule}.` : '';
  }
}

/**
 * @param {string} base
 * @param {Set<string>} taken
 */
function freeName(base, taken) {
  for (let number = 1; ; number += 1) {
    const name = number === 1 ? base : `${base}-${number}`;
    if (!taken.has(name)) return name;
  }
}

/**
 * @param {ZoneRule} rule
 * @param {number} number
 * @returns {(Node | string)[]} the direction or the limit of a rule, to change
 */
function parameter(rule, number) {
  if (rule.kind === 'crossed') {
    const options = Object.entries(DIRECTIONS).map(([value, textContent]) => make('option', { value, textContent, selected: value === (rule.direction ?? '') }));
    const direction = make('select', { ariaLabel: `Direction of rule ${number}` }, ...options);
    direction.addEventListener('change', () => (rule.direction = direction.value || null));
    return [direction];
  }
  const limit = LIMITS[/** @type {Kind} */ (rule.kind)];
  if (!limit) return [];
  const { key, unit, usual, most, isCount } = limit;
  rule[key] ??= usual;
  const field = make('input', { type: 'number', min: '0', max: String(most), step: isCount ? '1' : 'any', value: String(rule[key]), required: true });
  field.ariaLabel = `Limit of rule ${number}, ${unit}`;
  field.addEventListener('input', () => {
    rule[key] = field.valueAsNumber;
    field.setCustomValidity(!isCount && field.valueAsNumber === 0 ? 'Enter more than 0.' : '');
  });
  return [field, make('span', { textContent: unit })];
}

/**
 * @param {ZoneRule} rule
 * @param {number} number
 * @returns {(Node | string)[]} for how long it must last, to change
 */
function duration(rule, number) {
  if (!HELD.includes(rule.kind)) return [];
  rule.hold_s ??= HOLD_S;
  const field = make('input', { type: 'number', min: '0', max: String(MAX_HOLD_S), step: 'any', value: String(rule.hold_s), required: true });
  field.ariaLabel = `Rule ${number} must last, seconds`;
  field.addEventListener('input', () => (rule.hold_s = field.valueAsNumber));
  return ['for', field, make('span', { textContent: 'seconds' })];
}
