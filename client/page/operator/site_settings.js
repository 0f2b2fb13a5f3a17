/** The name of the site, and the rate and size of its streams, in the configuration file. A restart brings them into force. */

import { requestOperator } from '../shared/requests.js';
import { element, setText } from '../shared/dom.js';

/** @import {SiteFormat} from './api_types.js' */
/** @import {ShowError} from './section.js' */

/** @type {('name' | 'fps' | 'width' | 'height')[]} */
const FIELDS = ['name', 'fps', 'width', 'height'];
const LABELS = { name: 'name', fps: 'frames a second', width: 'width', height: 'height' };

export class SiteSettings {
  #state = element('site-state');
  /** @type {SiteFormat | null} in the file, as it was when it was shown */
  #shown = null;

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
      const now = await requestOperator('site_settings');
      if (this.isUnsaved) setText(this.#state, this.#describeChange(now));
      this.#show(now);
    } catch (error) {
      setText(this.#state, error instanceof Error ? error.message : '');
    }
  }

  /** Whether something was entered that is not in the file. */
  get isUnsaved() {
    return this.#edited.length > 0;
  }

  get #edited() {
    const shown = this.#shown;
    return shown ? FIELDS.filter((name) => field(name).value !== String(shown[name])) : [];
  }

  /**
   * Show the settings in the file; what was entered and not saved stays.
   *
   * @param {SiteFormat} now
   */
  #show(now) {
    const edited = this.#edited;
    for (const name of FIELDS) if (!edited.includes(name)) field(name).value = String(now[name]);
    this.#shown = now;
  }

  async #save() {
    const [fps, width, height] = ['fps', 'width', 'height'].map((name) => field(name).valueAsNumber);
    const digest = this.#shown?.digest;
    try {
      const saved = await requestOperator('site_settings', 'PUT', { name: field('name').value, fps, width, height, digest });
      this.#shown = null;
      this.#show(saved);
      setText(this.#state, 'Saved; the earlier file is kept.');
      await this.fileChanged();
    } catch (error) {
      /** @type {SiteFormat | null} */
      const now = await requestOperator('site_settings').catch(() => null);
      setText(this.#state, this.#describeChange(now) || (error instanceof Error ? error.message : ''));
      if (now) this.#show(now);
    }
  }

  /**
   * @param {SiteFormat | null} now in the file; null: unknown
   * @returns what others have changed in it; empty: nothing
   */
  #describeChange(now) {
    const before = this.#shown;
    if (!now || !before || now.digest === before.digest) return '';
    const theirs = FIELDS.filter((name) => now[name] !== before[name]).map((name) => `${LABELS[name]} ${now[name]}`);
    return `Somebody else has changed the site meanwhile: ${theirs.join(', ')}. What you entered is kept; press again to save it.`;
  }
}

/**
 * @param {string} name
 * @returns {HTMLInputElement}
 */
function field(name) {
  return element(`site-${name}`);
}
