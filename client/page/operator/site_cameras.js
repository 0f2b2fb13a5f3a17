/** The cameras in the configuration file: added after a trial, renamed, removed. A restart brings them into force. */

import { requestOperator } from '../shared/requests.js';
import { CameraSearch } from '../shared/camera_search.js';
import { element, make, onClick, setChildren, setText } from '../shared/dom.js';

/** @import {CameraTrial} from '../shared/api_types.js' */
/** @import {TrialAim} from '../shared/running_trials.js' */
/** @import {SiteCamera} from './api_types.js' */
/** @import {CameraTiles} from './camera_tiles.js' */
/** @import {Section, ShowError} from './section.js' */
/** @import {SiteSettings} from './site_settings.js' */

export class SiteCameras {
  #state = element('cameras-state');
  /** @type {HTMLSelectElement} */
  #instead = element('add-instead'); // the camera that gets the address; empty: a new one
  /** @type {HTMLInputElement} */
  #name = element('add-name');
  /** @type {Map<string, HTMLElement>} by camera */
  #items = new Map();
  /** @type {Map<string, string>} of the cameras as they are shown, which changes are based on */
  #digests = new Map();
  #hasResumed = false;

  /**
   * @param {ShowError} showError
   * @param {() => Promise<void>} fileChanged
   */
  constructor(showError, fileChanged) {
    this.showError = showError;
    this.fileChanged = fileChanged;
    this.search = new CameraSearch(
      element('camera-search'),
      {
        path: 'site_cameras',
        request: (trial) => this.#wanted(trial),
        showResult: (answer, aim) => this.#showResult(answer, aim),
        refused: () => void this.#refresh(),
      },
      showError,
    );
    this.#instead.addEventListener('change', () => (this.#name.disabled = this.#instead.value !== ''));
  }

  async load() {
    try {
      this.#show((await requestOperator('site_cameras')).cameras);
      if (!this.#hasResumed) this.search.resume();
      this.#hasResumed = true;
    } catch (error) {
      setText(this.#state, error instanceof Error ? error.message : '');
    }
  }

  /** @param {CameraTrial} trial */
  #wanted(trial) {
    const camera = this.#instead.value;
    return { ...trial, name: this.#name.value.trim() || trial.name, camera, digest: this.#digests.get(camera) };
  }

  /**
   * @param {{cameras: SiteCamera[], note: string}} answer
   * @param {TrialAim} aim
   * @returns {Promise<string>} what has become of the camera
   */
  async #showResult({ cameras, note }, { camera, name }) {
    this.#show(cameras);
    if (this.#name.value.trim() === name) this.#name.value = ''; // else another one was entered meanwhile
    if (this.#instead.value === camera) this.#instead.value = '';
    this.#name.disabled = this.#instead.value !== '';
    await this.fileChanged();
    return camera ? `is the address of ${camera} now${note && `; ${note}`}` : 'was added';
  }

  /** @param {SiteCamera[]} cameras */
  #show(cameras) {
    const chosen = this.#instead.value;
    const options = cameras.map(({ camera }) => make('option', { value: camera, textContent: camera, selected: camera === chosen }));
    this.#instead.replaceChildren(make('option', { value: '', textContent: 'a new camera' }), ...options);
    this.#digests = new Map(cameras.map(({ camera, digest }) => [camera, digest]));
    this.#items = new Map(cameras.map(({ camera }) => [camera, this.#items.get(camera) ?? this.#item(camera)]));
    for (const { camera, address, substream } of cameras) {
      const about = /** @type {HTMLElement} */ (this.#items.get(camera)?.lastElementChild);
      setText(about, `${address}${substream && `, people tracked in ${substream}`}`);
    }
    setChildren(element('site-cameras'), [...this.#items.values()]);
  }

  /** @param {string} camera */
  #item(camera) {
    const field = make('input', { value: camera, maxLength: 32, autocomplete: 'off', spellcheck: false });
    field.setAttribute('aria-label', `Name of camera ${camera}`);
    const rename = make('button', { type: 'submit', textContent: 'Rename' });
    rename.setAttribute('aria-label', `Rename camera ${camera}`);
    const remove = make('button', { type: 'button', textContent: 'Remove' });
    remove.setAttribute('aria-label', `Remove camera ${camera}`);
    onClick(remove, () => this.#change('DELETE', { camera }));
    const form = make('form', {}, field, rename, remove);
    form.addEventListener('submit', (event) => {
      event.preventDefault();
      void this.#change('PUT', { camera, name: field.value.trim() });
    });
    return make('li', { className: 'site-camera' }, form, make('p', { className: 'quiet' }));
  }

  /**
   * @param {'PUT' | 'DELETE'} method
   * @param {{camera: string, name?: string}} content
   */
  async #change(method, content) {
    try {
      const digest = this.#digests.get(content.camera);
      this.#show((await requestOperator('site_cameras', method, { ...content, digest })).cameras);
      this.showError(null);
      await this.fileChanged();
    } catch (error) {
      await this.#refresh();
      this.showError(error);
    }
  }

  /** Show what others have changed. */
  async #refresh() {
    await requestOperator('site_cameras').then(({ cameras }) => this.#show(cameras), this.showError);
  }
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

  get isUnsaved() {
    return this.settings.isUnsaved;
  }

  close() {
    this.tiles.close();
    this.configured.search.forgetLogin();
  }
}
