/** The configuration in force, read-only; settings that differ from the default are marked. */

import { requestOperator } from '../shared/requests.js';
import { element, make, setText } from '../shared/dom.js';

/** @import {Setting, Settings} from './api_types.js' */
/** @import {Section, ShowError} from './section.js' */

/** @implements {Section} */
export class ConfigurationTable {
  /** @type {Setting[]} */
  #settings = [];
  /** @type {HTMLInputElement} */
  #search = element('setting-search');
  #differingButton = element('only-non-defaults');

  /** @param {ShowError} showError */
  constructor(showError) {
    this.showError = showError;
    this.#search.addEventListener('input', () => this.#show());
    this.#differingButton.addEventListener('click', () => {
      this.#differingButton.setAttribute('aria-pressed', String(!this.#onlyDiffering));
      this.#show();
    });
  }

  open() {
    void requestOperator('config').then((/** @type {Settings} */ { settings, error, changed_keys: changedKeys }) => {
      this.#settings = settings;
      setText(element('config-file-status'), describeFile(error, changedKeys));
      this.#show();
    }, this.showError);
  }

  close() {}

  get #onlyDiffering() {
    return this.#differingButton.getAttribute('aria-pressed') === 'true';
  }

  #show() {
    const search = this.#search.value.trim().toLowerCase();
    const shown = this.#settings.filter(
      ({ key, value, default: usual, differs }) =>
        (differs || usual === null || !this.#onlyDiffering) && `${key}: ${value}`.toLowerCase().includes(search),
    );
    element('settings').replaceChildren(...shown.map(settingRow));
    setText(element('no-settings'), shown.length || !this.#settings.length ? '' : 'No matching setting.');
  }
}

/**
 * @param {string} error
 * @param {string[]} changedKeys
 */
function describeFile(error, changedKeys) {
  if (error) return `The file is not in force: ${error}`;
  return changedKeys.length ? `Changed in the file, not in force: ${changedKeys.join(', ')}` : '';
}

/** @param {Setting} setting */
function settingRow({ key, value, default: usual, differs }) {
  return make(
    'tr',
    { className: differs ? 'differs' : '' },
    make('th', { scope: 'row', textContent: key }),
    make('td', { textContent: value }),
    make('td', { textContent: differs && usual !== null ? usual : '' }),
  );
}
