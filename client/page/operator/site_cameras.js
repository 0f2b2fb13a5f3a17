/** The cameras in the configuration file: added after a trial, renamed, removed. A restart brings them into force. */

import { requestOperator } from '../shared/requests.js';
import { element, make, setText } from '../shared/dom.js';

/** @import {SiteCamera} from './api_types.js' */
/** @import {CameraTiles} from './camera_tiles.js' */
/** @import {Section, ShowError} from './section.js' */
/** @import {SiteSettings} from './site_settings.js' */

const TRIAL_TIMEOUT_MS = 120_000; // a camera may take long to answer

export class SiteCameras {
  #state = element('add-state');
  /** @type {HTMLSelectElement} */
  #instead = element('add-instead'); // the camera that gets the address; empty: a new one
  /** @type {HTMLInputElement} */
  #name = element('add-name');

  /**
   * @param {ShowError} showError
   * @param {() => Promise<void>} fileChanged
   */
  constructor(showError, fileChanged) {
    this.showError = showError;
    this.fileChanged = fileChanged;
    /** @type {HTMLFormElement} */
    const form = element('add-camera');
    form.addEventListener('submit', async (event) => {
      event.preventDefault();
      setText(this.#state, 'Trying…');
      const [address, user, password, name] = ['address', 'user', 'password', 'name'].map(fieldValue);
      const camera = this.#instead.value;
      const done = await this.#change('POST', { address, user, password, name, camera });
      const message = camera ? `It sends pictures: ${camera} has this address now.` : 'It sends pictures and was added.';
      setText(this.#state, done ? message : '');
      if (done) form.reset();
      this.#name.disabled = this.#instead.value !== '';
    });
    this.#instead.addEventListener('change', () => (this.#name.disabled = this.#instead.value !== ''));
  }

  async load() {
    try {
      this.#show((await requestOperator('site_cameras')).cameras);
    } catch (error) {
      setText(this.#state, error instanceof Error ? error.message : '');
    }
  }

  /** @param {SiteCamera[]} cameras */
  #show(cameras) {
    const chosen = this.#instead.value;
    const options = cameras.map(({ camera }) => make('option', { value: camera, textContent: camera, selected: camera === chosen }));
    this.#instead.replaceChildren(make('option', { value: '', textContent: 'a new camera' }), ...options);
    element('site-cameras').replaceChildren(...cameras.map((camera) => this.#item(camera)));
  }

  /** @param {SiteCamera} camera */
  #item({ camera, address }) {
    const field = make('input', { value: camera, maxLength: 32, autocomplete: 'off', spellcheck: false });
    field.setAttribute('aria-label', `Name of camera ${camera}`);
    const rename = make('button', { type: 'submit', textContent: 'Rename' });
    rename.setAttribute('aria-label', `Rename camera ${camera}`);
    const remove = make('button', { type: 'button', textContent: 'Remove' });
    remove.setAttribute('aria-label', `Remove camera ${camera}`);
    remove.addEventListener('click', () => void this.#change('DELETE', { camera }));
    const form = make('form', {}, field, rename, remove);
    form.addEventListener('submit', (event) => {
      event.preventDefault();
      void this.#change('PUT', { camera, name: field.value.trim() });
    });
    return make('li', { className: 'site-camera' }, form, make('p', { className: 'quiet', textContent: address }));
  }

  /**
   * @param {'POST' | 'PUT' | 'DELETE'} method
   * @param {object} content
   * @returns {Promise<boolean>} whether the file was changed
   */
  async #change(method, content) {
    try {
      this.#show((await requestOperator('site_cameras', method, content, TRIAL_TIMEOUT_MS)).cameras);
      this.showError(null);
      await this.fileChanged();
      return true;
    } catch (error) {
      this.showError(error);
      return false;
    }
  }
}

/** @param {string} name */
function fieldValue(name) {
  return /** @type {HTMLInputElement} */ (element(`add-${name}`)).value;
}

/**
 * The section of the cameras: those that run, and those in the configuration.
 *
 * @implements {Section}
 */
export class CamerasSection {
  /**
   * @param {CameraTiles} tiles
   * @param {SiteCameras} configured
   * @param {SiteSettings} settings
   */
  constructor(tiles, configured, settings) {
    this.tiles = tiles;
    this.configured = configured;
    this.settings = settings;
  }

  open() {
    this.tiles.open();
    void this.configured.load();
    void this.settings.load();
  }

  close() {
    this.tiles.close();
  }
}
