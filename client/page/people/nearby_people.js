/** Who is seen beside the chosen person, small. */

/** @import {Person} from '../shared/contract.js' */

export const MOST = 3; // of six connections to a server events, the large player and all else need three

export class Beside {
  /** @param {number[]} numbers */
  constructor(numbers) {
    this.numbers = numbers;
  }

  /**
   * @param {Person[] | null} people
   * @param {number | null} chosen
   * @returns {number[]} those of them who have a stream
   */
  shown(people, chosen) {
    const known = new Set(people?.map((person) => person.object));
    return this.numbers.filter((it) => it !== chosen && known.has(it)).slice(-MOST);
  }

  /**
   * Show somebody, or no more.
   *
   * @param {number} object
   * @param {number[]} shown
   */
  toggle(object, shown) {
    const others = shown.filter((it) => it !== object);
    this.numbers = shown.includes(object) ? others : [...others.slice(1 - MOST), object];
  }

  /**
   * Who was small and becomes large changes places with who was large.
   *
   * @param {number} object
   * @param {number | null} large
   */
  swap(object, large) {
    this.numbers = this.numbers.map((it) => (it === object && large !== null ? large : it));
  }

  /** @param {Person[] | null} people some of whom once had other numbers */
  rename(people) {
    const now = this.numbers.map((it) => people?.find((person) => person.aliases?.includes(it))?.object ?? it);
    this.numbers = [...new Set(now)];
  }
}
