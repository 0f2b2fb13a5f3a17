/** The rules on one zone, as rows of a form. */

import { element, make } from '../../shared/dom.js';

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
/** @type {Partial<Record<Kind, {key: 'longer_than_s' | 'more_than' | 'closer_than_m', unit: string, usual: number, step: string}>>} */
const LIMITS = {
  stayed: { key: 'longer_than_s', unit: 'seconds', usual: 60, step: 'any' },
  crowded: { key: 'more_than', unit: 'people', usual: 4, step: '1' },
  close: { key: 'closer_than_m', unit: 'meters', usual: 1.5, step: 'any' },
};
const DIRECTIONS = { '': 'either way', inward: 'inward', outward: 'outward' };

export class RuleList {
  /** @type {ZoneRule[]} */
  #rules = [];
  /** @type {Set<ZoneRule>} those that are not in the file yet, whose names can be chosen */
  #added = new Set();
  /** @type {Kind[]} that fit the zone */
  #kinds = [];
  #list = element('zone-rules');

  constructor() {
    element('zone-add-rule').addEventListener('click', () => {
      const rule = { rule: '', kind: this.#kinds[0], direction: null, longer_than_s: null, more_than: null, closer_than_m: null };
      this.#rules.push(rule);
      this.#added.add(rule);
      this.#show();
      this.#list.querySelectorAll('li')[this.#rules.length - 1].querySelector('select')?.focus();
    });
  }

  /**
   * @param {ZoneRule[]} rules
   * @param {Shape['kind']} shape of the zone
   * @param {string | null} camera of the zone
   */
  set(rules, shape, camera) {
    this.#rules = rules.map((rule) => ({ ...rule }));
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
    const taken = new Set(this.#rules.map(({ rule }) => rule));
    return this.#rules.map((rule) => {
      if (rule.rule) return rule;
      const names = [1, 2, 3, 4, 5, 6, 7, 8, 9].map((number) => `${zone}-${rule.kind}${number === 1 ? '' : `-${number}`}`);
      const name = names.find((free) => !taken.has(free)) ?? '';
      taken.add(name);
      return { ...rule, rule: name };
    });
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
      Object.assign(rule, { kind: kind.value, direction: null, longer_than_s: null, more_than: null, closer_than_m: null });
      this.#show();
      this.#list.querySelectorAll('li')[number - 1].querySelector('select')?.focus();
    });
    const remove = make('button', { type: 'button', textContent: 'Remove', ariaLabel: `Remove rule ${number}` });
    remove.addEventListener('click', () => {
      this.#rules.splice(number - 1, 1);
      this.#show();
      element('zone-add-rule').focus();
    });
    return make('li', {}, kind, ...parameter(rule, number), ...this.#name(rule, number), remove);
  }

  /**
   * @param {ZoneRule} rule
   * @param {number} number
   */
  #name(rule, number) {
    if (!this.#added.has(rule)) return [make('span', { className: 'quiet', textContent: rule.rule })];
    const name = make('input', { value: rule.rule, size: 12, maxLength: 32, placeholder: 'its name', spellcheck: false });
    name.ariaLabel = `Name of rule ${number}; empty: after the zone`;
    name.addEventListener('input', () => (rule.rule = name.value.trim()));
    return [name];
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
  const { key, unit, usual, step } = limit;
  rule[key] ??= usual;
  const field = make('input', { type: 'number', min: '0', step, value: String(rule[key]), required: true });
  field.ariaLabel = `Limit of rule ${number}, ${unit}`;
  field.addEventListener('input', () => (rule[key] = field.valueAsNumber));
  return [field, make('span', { textContent: unit })];
}
