/** What people are called: by their numbers, and by the names that an operator gave them. */

/** @type {Map<number, string>} */
const names = new Map();

/** @param {{object: number, name?: string | null}[]} people everybody who is known now */
export function learnNames(people) {
  names.clear();
  for (const { object, name } of people) if (name) names.set(object, name);
}

/** @param {number} object */
export function label(object) {
  const name = names.get(object);
  return name ? `${object} ${name}` : String(object);
}

/** @param {number} object */
export function person(object) {
  const name = names.get(object);
  return name ? `Person ${object}, ${name}` : `Person ${object}`;
}
