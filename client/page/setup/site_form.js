/** The site's name, rate and size, proposed until the user changes them; writing the configuration. */

import { element, setText } from '../shared/dom.js';
import { requestOperator } from '../shared/requests.js';

/** @import {SetupState, WrittenSite} from './api_types.js' */

const FIELDS = /** @type {const} */ (['fps', 'width', 'height']);

export class SiteForm {
  /** @type {HTMLInputElement} */
  #name = element('site-name');
  /** @type {HTMLButtonElement} */
  #start = element('start');
  /** @type {Set<string>} fields that the user has changed */
  #changed = new Set();

  /**
   * @param {(written: WrittenSite) => void} written
   * @param {(error: unknown) => void} showError null: no error
   */
  constructor(written, showError) {
    this.written = written;
    this.showError = showError;
    for (const name of FIELDS) this.#field(name).addEventListener('input', () => this.#changed.add(name));
    element('site-form').addEventListener('submit', (event) => {
      event.preventDefault();
      void this.#write();
    });
  }

  /** @param {SetupState} state */
  show({ cameras, proposal, file, exists }) {
    for (const name of FIELDS) if (!this.#changed.has(name)) this.#field(name).value = String(proposal[name]);
    this.#start.disabled = cameras.length === 0;
    setText(element('file'), exists ? `The file is ${file}; the present one is kept under another name.` : `The file is ${file}.`);
  }

  /**
   * @param {typeof FIELDS[number]} name
   * @returns {HTMLInputElement}
   */
  #field(name) {
    return element(`site-${name}`);
  }

  async #write() {
    this.#start.disabled = true;
    const [fps, width, height] = FIELDS.map((name) => this.#field(name).valueAsNumber);
    try {
      this.written(await requestOperator('setup/site', 'POST', { name: this.#name.value, fps, width, height }));
    } catch (error) {
      this.showError(error);
      this.#start.disabled = false;
      this.#start.focus();
    }
  }
}
