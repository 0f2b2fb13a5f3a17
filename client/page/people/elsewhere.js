/** People at other sites or in other areas, as links to them; the page goes with the selected person. */

import { make } from '../shared/dom.js';

/** @import {PersonElsewhere} from '../shared/api_types.js' */
/** @import {Viewer} from '../viewer.js' */

const SETTLED_MS = 3000; // after the page was opened: a person whom two sites or areas see for a moment is not followed to and fro

export class PeopleElsewhere {
  #shown = '';
  #opened = performance.now();
  /** @type {(PersonElsewhere & {address: string})[]} */
  #others = [];
  /** @type {number | undefined} */
  #due;

  /**
   * @param {HTMLDetailsElement} section with a list element
   * @param {Viewer} viewer
   */
  constructor(section, viewer) {
    this.section = section;
    this.list = /** @type {HTMLElement} */ (section.querySelector('ul'));
    this.viewer = viewer;
  }

  /** @param {PersonElsewhere[]} people known to the server, at other sites or at other services of this one */
  show(people) {
    const others = people.flatMap((person) => {
      const address = addressOf(person);
      return address === null ? [] : [{ ...person, address }];
    });
    const content = JSON.stringify(others);
    if (content !== this.#shown) {
      this.#shown = content;
      this.section.hidden = others.length === 0;
      this.list.replaceChildren(...others.map(item));
    }
    this.#others = others;
    clearTimeout(this.#due);
    const wait = this.#opened + SETTLED_MS - performance.now();
    if (wait <= 0) this.#follow();
    else this.#due = setTimeout(() => this.#follow(), wait);
  }

  #follow() {
    const selected = this.#others.find(({ object, visible }) => visible && object === this.viewer.object);
    if (selected && this.viewer.follows) location.assign(selected.address);
  }
}

/**
 * @param {PersonElsewhere} person
 * @returns {string | null} the address of the page there with this person; null: this page has them
 */
function addressOf({ object, server, visible }) {
  if (typeof visible !== 'boolean' || !server || !URL.canParse(server)) return null;
  const address = new URL(server);
  if (!['http:', 'https:'].includes(address.protocol)) return null;
  address.searchParams.set('object', String(object));
  return address.href;
}

/** @param {PersonElsewhere & {address: string}} person */
function item({ object, site, visible, address }) {
  const link = make('a', { href: address, textContent: `Person ${object}` });
  const place = site ? `${visible ? 'at' : 'left'} ${site}` : `${visible ? 'in' : 'was in'} another area`;
  return make('li', {}, link, ` ${place}`);
}
