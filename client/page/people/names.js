/** People's labels: their numbers, and the names that an operator gave them. */

/** @type {Map<number, string>} */
const names = new Map();

/** @param {{object: number, name?: string | null}[]} people all known people */
export function setNames(people) {
  names.clear();
  for (const { object, name } of people) if (name) names.set(object, name);
}

/**
 * @param {number} object
 * @returns {string} such as "3 Ann", or "3"
 */
export function shortLabel(object) {
  const name = names.get(object);
  return name ? `${object} ${name}` : String(object);
}

/**
 * @param {number} object
 * @returns {string} such as "Person 3, Ann", or "Person 3"
 */
export function longLabel(object) {
  const name = names.get(object);
  return name ? `Person ${object}, ${name}` : `Person ${object}`;
}
