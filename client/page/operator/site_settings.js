/** The name of the site, and the rate and size of its streams, in the configuration file. A restart brings them into force. */

import { requestOperator } from '../shared/requests.js';
import { element, setText } from '../shared/dom.js';

/** @import {SiteFormat} from './api_types.js' */
/** @import {ShowError} from './section.js' */

export class SiteSettings {
  #state = element('site-state');
  #digest = ''; // of the settings that are shown, before they are edited

  /**
   * @param {ShowError} showError
   * @param {() => Promise<void>} fileChanged
   */
  constructor(showError, fileChanged) {
    this.showError = showError;
    this.fileChanged = fileChanged;
    element('site-form').addEventListener('submit', (event) => {
      event.preventDefault();
      void this.#save();
    });
  }

  async load() {
    try {
      this.#show(await requestOperator('site_settings'));
    } catch (error) {
      setText(this.#state, error instanceof Error ? error.message : '');
    }
  }

  /** @param {SiteFormat} format */
  #show({ name, fps, width, height, digest }) {
    this.#digest = digest;
    field('name').value = name;
    field('fps').value = String(fps);
    field('width').value = String(width);
    field('height').value = String(height);
  }

  async #save() {
    const [fps, width, height] = ['fps', 'width', 'height'].map((name) => field(name).valueAsNumber);
    const digest = this.#digest;
    try {
      this.#show(await requestOperator('site_settings', 'PUT', { name: field('name').value, fps, width, height, digest }));
      setText(this.#state, 'Saved; the earlier file is kept.');
      await this.fileChanged();
    } catch (error) {
      await this.#showIfChanged();
      setText(this.#state, error instanceof Error ? error.message : '');
    }
  }

  /** Show the settings if others have changed them; else keep what was entered. */
  async #showIfChanged() {
    /** @type {SiteFormat | null} */
    const now = await requestOperator('site_settings').catch(() => null);
    if (now && now.digest !== this.#digest) this.#show(now);
  }
}

/**
 * @param {string} name
 * @returns {HTMLInputElement}
 */
function field(name) {
  return element(`site-${name}`);
}
