/** The people: what they are called, that two numbers are one person, that one number is two people. */

import { relative } from '../shared/requests.js';
import { label } from '../people/names.js';
import { ask } from './requests.js';
import { element, make, put } from './section.js';

/** @import {Person, Site} from '../shared/contract.js' */
/** @import {ByHand} from './contract.js' */
/** @import {Section, Tell} from './section.js' */

const EVERY_CAMERA = '';

/** @implements {Section} */
export class KnownPeople {
  /** @type {Map<number, Card>} */
  #cards = new Map();
  #words = element('known-words');
  /** @type {HTMLSelectElement} */
  #kept = element('merge-kept');
  /** @type {HTMLSelectElement} */
  #lost = element('merge-lost');
  /** @type {HTMLSelectElement} */
  #who = element('split-who');
  /** @type {HTMLSelectElement} */
  #camera = element('split-camera');

  /**
   * @param {Site} site
   * @param {Tell} tell
   */
  constructor(site, tell) {
    this.tell = tell;
    options(this.#camera, [[EVERY_CAMERA, 'every camera'], ...site.cameras.map((it) => /** @type {[string, string]} */ ([it, it]))]);
    element('merge-form').addEventListener('submit', (event) => {
      event.preventDefault();
      const [kept, lost] = [Number(this.#kept.value), Number(this.#lost.value)];
      void this.#say({ object: kept, merge: lost }, () => `${lost} is merged into ${kept}.`);
    });
    element('split-form').addEventListener('submit', (event) => {
      event.preventDefault();
      const split = this.#camera.value === EVERY_CAMERA ? [] : [this.#camera.value];
      void this.#say({ object: Number(this.#who.value), split }, ({ new_object }) => `Split off as person ${new_object}.`);
    });
  }

  open() {
    void ask('people').then((/** @type {ByHand} */ { unavailable }) => {
      if (unavailable) put(this.#words, unavailable);
    }, this.tell);
  }

  close() {}

  /** @param {Person[]} people */
  show(people) {
    const known = new Map(people.map((it) => [it.object, it]));
    for (const [object, card] of this.#cards) {
      if (known.has(object)) continue;
      card.item.remove();
      this.#cards.delete(object);
    }
    const list = element('known-people');
    for (const person of [...people].sort((one, other) => one.object - other.object)) {
      let card = this.#cards.get(person.object);
      if (!card) {
        card = new Card(person.object, (name) => this.#call(person.object, name));
        this.#cards.set(person.object, card);
        const after = [...list.children].find((it) => Number(/** @type {HTMLElement} */ (it).dataset.object) > person.object);
        list.insertBefore(card.item, after ?? null);
      }
      card.show(person);
    }
    const choices = [...known.keys()].sort((one, other) => one - other).map((it) => /** @type {[string, string]} */ ([String(it), label(it)]));
    for (const select of [this.#kept, this.#lost, this.#who]) options(select, choices);
    if (this.#lost.value === this.#kept.value) this.#lost.value = choices.find(([it]) => it !== this.#kept.value)?.[0] ?? '';
    if (!people.length) put(this.#words, 'No people yet.');
    else if (this.#words.textContent === 'No people yet.') put(this.#words, '');
  }

  /**
   * @param {number} object
   * @param {string} name
   */
  #call(object, name) {
    void this.#say({ object, name }, () => (name.trim() ? `${object} is called ${name.trim()}.` : `${object} has no name.`));
  }

  /**
   * @param {object} said
   * @param {(answer: ByHand) => string} words what is true then
   */
  async #say(said, words) {
    try {
      put(this.#words, words(await ask('people', 'POST', said)));
      this.tell(null);
    } catch (error) {
      this.tell(error);
    }
  }
}

class Card {
  #thumbnail = '';
  #name = ''; // as the server says

  /**
   * @param {number} object
   * @param {(name: string) => void} call
   */
  constructor(object, call) {
    this.image = make('img', { alt: '' });
    this.seen = make('span', { className: 'quiet' });
    this.input = make('input', { type: 'text', maxLength: 40, autocomplete: 'off', placeholder: 'Name', ariaLabel: `Name of person ${object}` });
    const form = make('form', {}, this.input, make('button', { type: 'submit', textContent: 'Rename' }));
    form.addEventListener('submit', (event) => {
      event.preventDefault();
      this.#name = this.input.value.trim();
      call(this.input.value);
    });
    const number = make('strong', { textContent: String(object) });
    this.item = make('li', {}, make('span', { className: 'face' }, this.image), make('p', {}, number, ' ', this.seen), form);
    this.item.dataset.object = String(object);
  }

  /** @param {Person} person */
  show({ name, cameras, aliases, thumbnail }) {
    const once = aliases?.length ? `, once ${aliases.join(', ')}` : '';
    put(this.seen, (cameras.length ? `seen by ${cameras.join(', ')}` : 'not in view') + once);
    const typing = document.activeElement === this.input || this.input.value !== this.#name;
    if (!typing) this.input.value = name ?? '';
    if (!typing) this.#name = name ?? '';
    if (!thumbnail || thumbnail === this.#thumbnail) return;
    this.#thumbnail = thumbnail;
    this.image.src = relative(thumbnail);
  }
}

/**
 * Choices that are the same stay untouched, and what is chosen stays chosen.
 *
 * @param {HTMLSelectElement} select
 * @param {[string, string][]} choices value and words
 */
function options(select, choices) {
  const said = JSON.stringify(choices);
  if (select.dataset.choices === said) return;
  select.dataset.choices = said;
  const chosen = select.value;
  select.replaceChildren(...choices.map(([value, textContent]) => make('option', { value, textContent })));
  if (choices.some(([value]) => value === chosen)) select.value = chosen;
}
