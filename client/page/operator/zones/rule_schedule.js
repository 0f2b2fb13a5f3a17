/** What restricts a rule to times, people and clear pictures, as text. */

/** @import {ZoneRule} from '../api_types.js' */

/** @typedef {Pick<ZoneRule, 'people' | 'days' | 'hours' | 'cameras'>} Restrictions */

export const DAYS = /** @type {const} */ (['mon', 'tue', 'wed', 'thu', 'fri', 'sat', 'sun']);
/** @type {Record<string, string>} */
export const DAY_NAMES = { mon: 'Mon', tue: 'Tue', wed: 'Wed', thu: 'Thu', fri: 'Fri', sat: 'Sat', sun: 'Sun' };
const MAX_PEOPLE = 100;
const MAX_NUMBER = 999_999_999;

/**
 * @param {Restrictions} rule
 * @returns {string} such as "Mon–Fri, 22:00 to 06:00 of the next day, for 3, Ann, while c0 is clear"
 */
export function describeRestrictions({ people, days, hours, cameras }) {
  const parts = [
    describeDays(days),
    hours && hours[0] !== hours[1] ? `${hours[0]} to ${hours[1]}${hours[1] < hours[0] ? ' of the next day' : ''}` : '',
    people.length ? `for ${people.join(', ')}` : '',
    cameras.length ? `while ${cameras.join(', ')} ${cameras.length > 1 ? 'are' : 'is'} clear` : '',
  ].filter(Boolean);
  return parts.length ? parts.join(', ') : 'always, for everybody';
}

/**
 * @param {string[] | null} chosen null: all
 * @returns {string} such as "Mon–Wed, Sat"; empty: all days
 */
function describeDays(chosen) {
  if (!chosen) return '';
  /** @type {number[][]} first and last of days that follow each other */
  const runs = [];
  DAYS.forEach((day, at) => {
    if (!chosen.includes(day)) return;
    const last = runs[runs.length - 1];
    if (last && last[1] === at - 1) last[1] = at;
    else runs.push([at, at]);
  });
  const name = (/** @type {number} */ at) => DAY_NAMES[DAYS[at]];
  return runs.map(([first, last]) => (first === last ? name(first) : `${name(first)}–${name(last)}`)).join(', ');
}

/**
 * @param {(number | string)[]} people
 * @returns {string} numbers and names with commas between them; names that would be read otherwise are quoted
 */
export function writePeople(people) {
  return people.map((person) => (typeof person === 'string' && /^\s|\s$|^\d+$|[",]/.test(person) ? JSON.stringify(person) : person)).join(', ');
}

/**
 * @param {string} text
 * @returns {(number | string)[]}
 * @throws {Error} with what is wrong
 */
export function readPeople(text) {
  if (text.trim() === '') return [];
  const tokens = text.match(/\s*("(?:[^"\\]|\\.)*"|[^",]*)\s*(?:,|$)/g)?.slice(0, text.trim().endsWith(',') ? undefined : -1) ?? [];
  if (tokens.join('') !== text) throw new Error('Enter numbers or names with commas between them.');
  const people = tokens.map((token) => readPerson(token.replace(/,$/, '').trim()));
  if (people.length > MAX_PEOPLE) throw new Error(`Enter at most ${MAX_PEOPLE} people.`);
  return people;
}

/** @param {string} token */
function readPerson(token) {
  const person = token.startsWith('"') ? JSON.parse(token) : /^\d+$/.test(token) ? Number(token) : token;
  if (person === '') throw new Error('Enter numbers or names with commas between them.');
  if (Number(person) > MAX_NUMBER && typeof person === 'number') throw new Error(`${token} is no person's number.`);
  return person;
}
