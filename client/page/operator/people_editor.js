/** The people: renaming them, merging two numbers into one person, and splitting one number into two. */

import { relative, requestOperator } from '../shared/requests.js';
import { shortLabel } from '../people/names.js';
import { PersonDeletion } from './person_deletion.js';
import { element, make, setText } from '../shared/dom.js';

/** @import {Person, Site} from '../shared/api_types.js' */
/** @import {ManualOverrides} from './api_types.js' */
/** @import {Section, ShowError} from './section.js' */

const ALL_CAMERAS = '';
const NO_PEOPLE = 'No people yet.';

/** @typedef {[string, string]} Option value and text */

/** @implements {Section} */
export class PeopleEditor {
  /** @type {Map<number, PersonEditor>} */
  #editors = new Map();
  #message = element('people-message');
  /** @type {HTMLSelectElement} */
  #mergeKept = element('merge-kept');
  /** @type {HTMLSelectElement} */
  #mergeLost = element('merge-lost');
  /** @type {HTMLSelectElement} */
  #splitObject = element('split-object');
  /** @type {HTMLSelectElement} */
  #splitCamera = element('split-camera');

  /**
   * @param {Site} site
   * @param {ShowError} showError
   */
  constructor(site, showError) {
    this.showError = showError;
    new PersonDeletion(showError);
    const cameras = site.cameras.map((camera) => /** @type {Option} */ ([camera, camera]));
    setOptions(this.#splitCamera, [[ALL_CAMERAS, 'every camera'], ...cameras]);
    element('merge-form').addEventListener('submit', (event) => {
      event.preventDefault();
      const [kept, lost] = [Number(this.#mergeKept.value), Number(this.#mergeLost.value)];
      void this.#post({ object: kept, merge: lost }, () => `${lost} is merged into ${kept}.`);
    });
    element('split-form').addEventListener('submit', (event) => {
      event.preventDefault();
      const split = this.#splitCamera.value === ALL_CAMERAS ? [] : [this.#splitCamera.value];
      const object = Number(this.#splitObject.value);
      void this.#post({ object, split }, ({ new_object: added }) => `Split off as person ${added}.`);
    });
  }

  open() {
    void requestOperator('people').then((/** @type {ManualOverrides} */ { unavailable }) => {
      if (unavailable) setText(this.#message, unavailable);
    }, this.showError);
  }

  close() {}

  /** @param {Person[]} people */
  show(people) {
    const known = new Map(people.map((person) => [person.object, person]));
    for (const [object, editor] of this.#editors) {
      if (known.has(object)) continue;
      editor.item.remove();
      this.#editors.delete(object);
    }
    const list = element('people-list');
    for (const person of [...people].sort((a, b) => a.object - b.object)) {
      let editor = this.#editors.get(person.object);
      if (!editor) {
        editor = new PersonEditor(person.object, (name) => this.#rename(person.object, name));
        this.#editors.set(person.object, editor);
        const next = [...list.children].find((item) => Number(/** @type {HTMLElement} */ (item).dataset.object) > person.object);
        list.insertBefore(editor.item, next ?? null);
      }
      editor.show(person);
    }
    const numbers = [...known.keys()].sort((a, b) => a - b);
    const options = numbers.map((number) => /** @type {Option} */ ([String(number), shortLabel(number)]));
    for (const select of [this.#mergeKept, this.#mergeLost, this.#splitObject]) setOptions(select, options);
    if (this.#mergeLost.value === this.#mergeKept.value) {
      this.#mergeLost.value = options.find(([value]) => value !== this.#mergeKept.value)?.[0] ?? '';
    }
    if (!people.length) setText(this.#message, NO_PEOPLE);
    else if (this.#message.textContent === NO_PEOPLE) setText(this.#message, '');
  }

  /**
   * @param {number} object
   * @param {string} name
   */
  #rename(object, name) {
    void this.#post({ object, name }, () => (name.trim() ? `${object} is called ${name.trim()}.` : `${object} has no name.`));
  }

  /**
   * @param {object} change
   * @param {(answer: ManualOverrides) => string} confirmation
   */
  async #post(change, confirmation) {
    try {
      setText(this.#message, confirmation(await requestOperator('people', 'POST', change)));
      this.showError(null);
    } catch (error) {
      this.showError(error);
    }
  }
}

class PersonEditor {
  #thumbnail = '';
  #name = ''; // known to the server

  /**
   * @param {number} object
   * @param {(name: string) => void} rename
   */
  constructor(object, rename) {
    this.image = make('img', { alt: '' });
    this.seenBy = make('span', { className: 'quiet' });
    const ariaLabel = `Name of person ${object}`;
    this.input = make('input', { type: 'text', maxLength: 40, autocomplete: 'off', placeholder: 'Name', ariaLabel });
    const form = make('form', {}, this.input, make('button', { type: 'submit', textContent: 'Rename' }));
    form.addEventListener('submit', (event) => {
      event.preventDefault();
      this.#name = this.input.value.trim();
      rename(this.input.value);
    });
    const number = make('strong', { textContent: String(object) });
    const face = make('span', { className: 'face' }, this.image);
    this.item = make('li', {}, face, make('p', {}, number, ' ', this.seenBy), form);
    this.item.dataset.object = String(object);
  }

  /** @param {Person} person */
  show({ name, cameras, aliases, thumbnail }) {
    const formerly = aliases?.length ? `, formerly ${aliases.join(', ')}` : '';
    setText(this.seenBy, (cameras.length ? `seen by ${cameras.join(', ')}` : 'not in view') + formerly);
    const editing = document.activeElement === this.input || this.input.value !== this.#name;
    if (!editing) this.input.value = this.#name = name ?? '';
    if (!thumbnail || thumbnail === this.#thumbnail) return;
    this.#thumbnail = thumbnail;
    this.image.src = relative(thumbnail);
  }
}

/**
 * Set the options of a select element if they differ, and keep the selected one.
 *
 * @param {HTMLSelectElement} select
 * @param {Option[]} options
 */
function setOptions(select, options) {
  const json = JSON.stringify(options);
  if (select.dataset.options === json) return;
  select.dataset.options = json;
  const selected = select.value;
  select.replaceChildren(...options.map(([value, textContent]) => make('option', { value, textContent })));
  if (options.some(([value]) => value === selected)) select.value = selected;
}
