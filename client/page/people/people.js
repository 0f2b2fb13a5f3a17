/**
 * The people to choose from, a card each: living thumbnail, number, who sees them.
 *
 * Cards are kept from one list to the next, so that focus stays where it is and pictures do not flash.
 */

import { relative } from '../shared/requests.js';
import { label, person as personCalled } from './names.js';

/** @import {Person} from '../shared/contract.js' */
/** @import {Palette} from './palette.js' */

export class People {
  /** @type {Map<number, Card>} */
  #cards = new Map();

  /**
   * @param {HTMLElement} here list element for those who are or were just in view
   * @param {HTMLDetailsElement} earlier holds a list element for those who have not been for a while
   * @param {(object: number) => void} choose
   * @param {(object: number) => void} beside to be seen beside the chosen person, or no more
   */
  constructor(here, earlier, choose, beside) {
    this.here = here;
    this.earlier = earlier;
    this.gone = /** @type {HTMLElement} */ (earlier.querySelector('ul'));
    this.choose = choose;
    this.beside = beside;
  }

  /**
   * @param {Person[]} people
   * @param {number | null} chosen
   * @param {number[]} beside
   * @param {Palette} palette
   * @param {(person: Person) => boolean} isGone not in view for a while
   */
  show(people, chosen, beside, palette, isGone) {
    const known = new Set(people.map((person) => person.object));
    for (const [object, card] of this.#cards) {
      if (known.has(object)) continue;
      card.item.remove();
      this.#cards.delete(object);
    }
    for (const person of [...people].sort((a, b) => a.object - b.object)) {
      const card = this.#card(person.object);
      card.update(person, person.object === chosen, beside.includes(person.object), palette);
      const away = isGone(person) && person.object !== chosen;
      this.#place(card.item, away ? this.gone : this.here, person.object);
    }
    this.earlier.hidden = this.gone.children.length === 0;
  }

  /** @param {number} object */
  #card(object) {
    let card = this.#cards.get(object);
    if (!card) {
      card = new Card(object, () => this.choose(object), () => this.beside(object));
      this.#cards.set(object, card);
    }
    return card;
  }

  /**
   * In the order of the numbers; a card that is in its place is not touched, or it would lose the focus.
   *
   * @param {HTMLElement} item
   * @param {HTMLElement} list
   * @param {number} object
   */
  #place(item, list, object) {
    if (item.parentElement === list) return;
    const after = [...list.children].find((other) => Number(/** @type {HTMLElement} */ (other).dataset.object) > object);
    list.insertBefore(item, after ?? null);
  }
}

class Card {
  #thumbnail = '';

  /**
   * @param {number} object
   * @param {() => void} choose
   * @param {() => void} beside
   */
  constructor(object, choose, beside) {
    this.item = document.createElement('li');
    this.item.dataset.object = String(object);
    this.button = document.createElement('button');
    this.button.type = 'button';
    this.button.className = 'person';
    this.button.addEventListener('click', choose);
    this.image = document.createElement('img');
    this.image.alt = '';
    this.image.hidden = true;
    this.seenBy = element('span', 'seen-by');
    const picture = element('span', 'thumbnail');
    this.number = element('span', 'number');
    this.words = element('span', 'unseen'); // what is to be seen, for those who hear it
    picture.ariaHidden = this.seenBy.ariaHidden = 'true';
    picture.append(this.image, this.number);
    this.button.append(picture, this.seenBy, this.words);
    this.plus = document.createElement('button');
    this.plus.type = 'button';
    this.plus.className = 'plus';
    this.plus.textContent = '+';
    this.plus.addEventListener('click', beside);
    this.item.append(this.button, this.plus);
  }

  /**
   * @param {Person} person
   * @param {boolean} chosen
   * @param {boolean} beside
   * @param {Palette} palette
   */
  update(person, chosen, beside, palette) {
    this.plus.hidden = chosen;
    this.plus.setAttribute('aria-pressed', String(beside));
    this.plus.ariaLabel = this.plus.title = `Person ${person.object} beside the large picture`;
    this.button.setAttribute('aria-current', String(chosen));
    this.button.classList.toggle('away', !person.visible);
    const seen = person.cameras.length ? `seen by ${person.cameras.join(', ')}` : 'not in view';
    this.words.textContent = this.button.title = `${personCalled(person.object)}, ${seen}`;
    const called = label(person.object);
    if (this.number.textContent !== called) this.number.textContent = called;
    this.#showCameras(person, palette);
    if (person.thumbnail && person.thumbnail !== this.#thumbnail) void this.#load(person.thumbnail);
  }

  /**
   * @param {Person} person
   * @param {Palette} palette
   */
  #showCameras(person, palette) {
    const text = person.cameras.join(' ');
    if (this.seenBy.dataset.cameras === text) return;
    this.seenBy.dataset.cameras = text;
    const chips = person.cameras.map((camera) => {
      const chip = element('span', 'chip');
      chip.style.setProperty('--camera', palette.colour(camera));
      chip.textContent = camera;
      return chip;
    });
    if (chips.length) this.seenBy.replaceChildren(...chips);
    else this.seenBy.textContent = 'not in view';
  }

  /**
   * Shown only when it is there, so that the old picture stays until then.
   *
   * @param {string} address
   */
  async #load(address) {
    this.#thumbnail = address;
    const next = new Image();
    next.alt = '';
    next.src = relative(address);
    try {
      await next.decode();
    } catch {
      this.#thumbnail = ''; // the next list tries again
      return;
    }
    if (this.#thumbnail !== address) return;
    this.image.replaceWith(next);
    this.image = next;
  }
}

/**
 * @param {string} name
 * @param {string} className
 */
function element(name, className) {
  const made = document.createElement(name);
  made.className = className;
  return made;
}
