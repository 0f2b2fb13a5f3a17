/** Fields for when and for whom a rule applies, folded under a line that says it. */

import { make, setText } from '../../shared/dom.js';
import { DAY_NAMES, DAYS, describeRestrictions, readPeople, writePeople } from './rule_schedule.js';

/** @import {ZoneRule} from '../api_types.js' */

/**
 * @param {ZoneRule} rule is changed
 * @param {number} number
 * @param {string[]} cameras of the site
 * @returns {HTMLElement}
 */
export function restrictionFields(rule, number, cameras) {
  const summary = make('summary');
  const changed = () => setText(summary, `When and for whom: ${describeRestrictions(rule)}`);
  const details = make(
    'details', {}, summary, peopleField(rule, number, changed), ...dayFields(rule, changed), ...hourFields(rule, number, changed), ...cameraFields(rule, cameras, changed),
  );
  details.addEventListener('invalid', () => (details.open = true), true); // else the browser could not show why
  changed();
  return details;
}

/**
 * @param {ZoneRule} rule
 * @param {number} number
 * @param {() => void} changed
 */
function peopleField(rule, number, changed) {
  const field = make('input', { value: writePeople(rule.people), placeholder: 'everybody', autocomplete: 'off', maxLength: 5000, spellcheck: false });
  field.ariaLabel = `People of rule ${number}: numbers or names, with commas`;
  field.addEventListener('input', () => {
    try {
      rule.people = readPeople(field.value);
      field.setCustomValidity('');
      changed();
    } catch (error) {
      field.setCustomValidity(error instanceof SyntaxError ? 'Close the quotes.' : /** @type {Error} */ (error).message);
    }
  });
  return make('p', { className: 'buttons' }, make('label', {}, 'Only these people ', field));
}

/**
 * @param {ZoneRule} rule
 * @param {() => void} changed
 */
function dayFields(rule, changed) {
  const boxes = DAYS.map((day) => make('input', { type: 'checkbox', checked: !rule.days || rule.days.includes(day) }));
  const read = () => {
    const chosen = DAYS.filter((_, at) => boxes[at].checked);
    rule.days = chosen.length < DAYS.length ? chosen : null;
    boxes[0].setCustomValidity(chosen.length ? '' : 'Choose at least one day.');
    changed();
  };
  for (const box of boxes) box.addEventListener('change', read);
  const labels = DAYS.map((day, at) => make('label', {}, boxes[at], ` ${DAY_NAMES[day]}`));
  return [make('fieldset', { className: 'buttons' }, make('legend', { textContent: 'On' }), ...labels)];
}

/**
 * @param {ZoneRule} rule
 * @param {number} number
 * @param {() => void} changed
 */
function hourFields(rule, number, changed) {
  const [from, to] = ['from', 'to'].map((end, at) => {
    const field = make('input', { type: 'time', value: rule.hours?.[at] ?? '' });
    field.ariaLabel = `Rule ${number} applies ${end}`;
    return field;
  });
  const read = () => {
    const isHalf = (from.value === '') !== (to.value === '');
    for (const field of [from, to]) field.setCustomValidity(isHalf && field.value === '' ? 'Enter both times, or none for all day.' : '');
    rule.hours = from.value && to.value ? [from.value, to.value] : null;
    changed();
  };
  for (const field of [from, to]) field.addEventListener('input', read);
  const allDay = make('button', { type: 'button', textContent: 'All day', ariaLabel: `Rule ${number} applies all day` });
  allDay.addEventListener('click', () => {
    from.value = to.value = '';
    read();
  });
  return [make('p', { className: 'buttons' }, make('label', {}, 'From ', from), make('label', {}, 'to ', to), allDay)];
}

/**
 * @param {ZoneRule} rule
 * @param {string[]} cameras
 * @param {() => void} changed
 */
function cameraFields(rule, cameras, changed) {
  const known = [...cameras, ...rule.cameras.filter((camera) => !cameras.includes(camera))];
  const labels = known.map((camera) => {
    const box = make('input', { type: 'checkbox', checked: rule.cameras.includes(camera) });
    box.addEventListener('change', () => {
      rule.cameras = known.filter((name) => (name === camera ? box.checked : rule.cameras.includes(name)));
      changed();
    });
    return make('label', {}, box, ` ${camera}`);
  });
  return [make('fieldset', { className: 'buttons' }, make('legend', { textContent: 'Only while these send a clear picture' }), ...labels)];
}
