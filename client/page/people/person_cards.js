/**
 * A card for each person: thumbnail, number, and the cameras that see them.
 *
 * Cards are kept between updates, so that the focus stays and pictures do not flash.
 */

import { make, setText } from '../shared/dom.js';
import { relative } from '../shared/requests.js';
import { longLabel, shortLabel } from './names.js';

/** @import {Person} from '../shared/api_types.js' */
/** @import {Palette} from './palette.js' */

export class PersonCards {
  /** @type {Map<number, PersonCard>} */
  #cards = new Map();

  /**
   * @param {HTMLElement} recent list element for people who are, or were recently, in view
   * @param {HTMLDetailsElement} earlier with a list element for all others
   * @param {(object: number) => void} select
   * @param {(object: number) => void} toggleTile show a person on a small tile, or no longer
   */
  constructor(recent, earlier, select, toggleTile) {
    this.recent = recent;
    this.earlier = earlier;
    this.earlierList = /** @type {HTMLElement} */ (earlier.querySelector('ul'));
    this.select = select;
    this.toggleTile = toggleTile;
  }

  /**
   * @param {Person[]} people
   * @param {number | null} selected
   * @param {number[]} tiles people on small tiles
   * @param {Palette} palette
   * @param {(person: Person) => boolean} isGone not in view for a while
   */
  show(people, selected, tiles, palette, isGone) {
    const known = new Set(people.map((person) => person.object));
    for (const [object, card] of this.#cards) {
      if (known.has(object)) continue;
      card.item.remove();
      this.#cards.delete(object);
    }
    for (const person of [...people].sort((a, b) => a.object - b.object)) {
      const card = this.#card(person.object);
      card.update(person, person.object === selected, tiles.includes(person.object), palette);
      const earlier = isGone(person) && person.object !== selected;
      this.#place(card.item, earlier ? this.earlierList : this.recent, person.object);
    }
    this.earlier.hidden = this.earlierList.children.length === 0;
  }

  /** @param {number} object */
  #card(object) {
    let card = this.#cards.get(object);
    if (!card) {
      card = new PersonCard(object, () => this.select(object), () => this.toggleTile(object));
      this.#cards.set(object, card);
    }
    return card;
  }

  /**
   * Insert a card in the order of numbers. A card already on the list is not moved, or it would lose the focus.
   *
   * @param {HTMLElement} item
   * @param {HTMLElement} list
   * @param {number} object
   */
  #place(item, list, object) {
    if (item.parentElement === list) return;
    const next = [...list.children].find((sibling) => Number(/** @type {HTMLElement} */ (sibling).dataset.object) > object);
    list.insertBefore(item, next ?? null);
  }
}

class PersonCard {
  #thumbnail = '';

  /**
   * @param {number} object
   * @param {() => void} select
   * @param {() => void} toggleTile
   */
  constructor(object, select, toggleTile) {
    this.image = make('img', { alt: '', hidden: true });
    this.number = make('span', { className: 'number' });
    this.cameras = make('span', { className: 'seen-by', ariaHidden: 'true' });
    this.description = make('span', { className: 'visually-hidden' }); // for screen readers
    const picture = make('span', { className: 'thumbnail', ariaHidden: 'true' }, this.image, this.number);
    this.button = make('button', { type: 'button', className: 'person' }, picture, this.cameras, this.description);
    this.button.addEventListener('click', select);
    this.plus = make('button', { type: 'button', className: 'plus', textContent: '+' });
    this.plus.addEventListener('click', toggleTile);
    this.item = make('li', {}, this.button, this.plus);
    this.item.dataset.object = String(object);
  }

  /**
   * @param {Person} person
   * @param {boolean} selected
   * @param {boolean} onTile
   * @param {Palette} palette
   */
  update(person, selected, onTile, palette) {
    this.plus.hidden = selected;
    this.plus.setAttribute('aria-pressed', String(onTile));
    this.plus.ariaLabel = this.plus.title = `Person ${person.object} beside the large picture`;
    this.button.setAttribute('aria-current', String(selected));
    this.button.classList.toggle('away', !person.visible);
    const seen = person.cameras.length ? `seen by ${person.cameras.join(', ')}` : 'not in view';
    this.description.textContent = this.button.title = `${longLabel(person.object)}, ${seen}`;
    setText(this.number, shortLabel(person.object));
    this.#showCameras(person, palette);
    if (person.thumbnail && person.thumbnail !== this.#thumbnail) void this.#load(person.thumbnail);
  }

  /**
   * @param {Person} person
   * @param {Palette} palette
   */
  #showCameras(person, palette) {
    const text = person.cameras.join(' ');
    if (this.cameras.dataset.cameras === text) return;
    this.cameras.dataset.cameras = text;
    const chips = person.cameras.map((camera) => {
      const chip = make('span', { className: 'chip', textContent: camera });
      chip.style.setProperty('--camera', palette.color(camera));
      return chip;
    });
    if (chips.length) this.cameras.replaceChildren(...chips);
    else this.cameras.textContent = 'not in view';
  }

  /**
   * Replace the thumbnail when the new one is decoded.
   *
   * @param {string} address
   */
  async #load(address) {
    this.#thumbnail = address;
    const image = make('img', { alt: '', src: relative(address) });
    try {
      await image.decode();
    } catch {
      this.#thumbnail = ''; // the next update retries
      return;
    }
    if (this.#thumbnail !== address) return;
    this.image.replaceWith(image);
    this.image = image;
  }
}
