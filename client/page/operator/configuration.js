/** The configuration in force, to read: what differs from the default is marked. */

import { ask } from './requests.js';
import { element, make, put } from './section.js';

/** @import {Setting, Settings} from './contract.js' */
/** @import {Section, Tell} from './section.js' */

/** @implements {Section} */
export class Configuration {
  /** @type {Setting[]} */
  #settings = [];
  /** @type {HTMLInputElement} */
  #find = element('find-setting');
  #only = element('only-differing');

  /** @param {Tell} tell */
  constructor(tell) {
    this.tell = tell;
    this.#find.addEventListener('input', () => this.#show());
    this.#only.addEventListener('click', () => {
      this.#only.setAttribute('aria-pressed', String(!this.#onlyDiffering));
      this.#show();
    });
  }

  open() {
    void ask('config').then((/** @type {Settings} */ { settings, error, pending_restart: pending }) => {
      this.#settings = settings;
      put(element('config-on-disk'), onDisk(error, pending));
      this.#show();
    }, this.tell);
  }

  close() {}

  get #onlyDiffering() {
    return this.#only.getAttribute('aria-pressed') === 'true';
  }

  #show() {
    const wanted = this.#find.value.trim().toLowerCase();
    const shown = this.#settings.filter(
      (it) => (it.differs || it.default === null || !this.#onlyDiffering) && `${it.key}: ${it.value}`.toLowerCase().includes(wanted),
    );
    element('settings').replaceChildren(...shown.map(row));
    put(element('settings-none'), shown.length || !this.#settings.length ? '' : 'No matching setting.');
  }
}

/**
 * @param {string} error
 * @param {string[]} pending
 */
function onDisk(error, pending) {
  if (error) return `The file is not in force: ${error}`;
  return pending.length ? `Changed in the file, not in force: ${pending.join(', ')}` : '';
}

/** @param {Setting} setting */
function row({ key, value, default: usual, differs }) {
  return make(
    'tr',
    { className: differs ? 'differs' : '' },
    make('th', { scope: 'row', textContent: key }),
    make('td', { textContent: value }),
    make('td', { textContent: differs && usual !== null ? usual : '' }),
  );
}
