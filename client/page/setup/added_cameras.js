/** Tiles of the cameras that were tried: picture, name, removal. */

import { element, make, onClick, setChildren } from '../shared/dom.js';
import { requestOperator } from '../shared/requests.js';

/** @import {AddedCamera, SetupState} from './api_types.js' */

export class AddedCameras {
  /** @type {Map<number, HTMLElement>} by key */
  #tiles = new Map();

  /**
   * @param {(state: SetupState) => void} show
   * @param {(error: unknown) => void} showError null: no error
   */
  constructor(show, showError) {
    this.update = show;
    this.showError = showError;
  }

  /** @param {AddedCamera[]} cameras */
  show(cameras) {
    const tiles = new Map(cameras.map((camera) => [camera.key, this.#tiles.get(camera.key) ?? this.#tile(camera)]));
    this.#tiles = tiles;
    setChildren(element('added'), [...tiles.values()]);
    element('no-cameras').hidden = cameras.length > 0;
  }

  /** @param {AddedCamera} camera */
  #tile({ key, name, address, sends, tracked_in: tracked }) {
    const picture = make('img', { src: `api/operator/setup/cameras/${key}/picture.jpg`, alt: `Picture of ${name}` });
    const field = make('input', { value: name, maxLength: 32, autocomplete: 'off', spellcheck: false });
    field.setAttribute('aria-label', `Name of the camera at ${address}`);
    let last = name;
    field.addEventListener('change', async () => {
      if (await this.#request(`setup/cameras/${key}`, 'PUT', { name: field.value.trim() })) last = field.value = field.value.trim();
      else field.value = last;
      picture.alt = `Picture of ${last}`;
    });
    const remove = make('button', { type: 'button', textContent: 'Remove' });
    remove.setAttribute('aria-label', `Remove the camera at ${address}`);
    onClick(remove, async () => {
      const { nextElementSibling: next, previousElementSibling: previous } = tile;
      if (!(await this.#request(`setup/cameras/${key}`, 'DELETE'))) return;
      (next ?? previous)?.querySelector('input')?.focus(); // the keyboard's focus was on what is gone
      if (!next && !previous) element('address').focus();
    });
    const tile = make(
      'li',
      { className: 'camera-tile added-camera' },
      make('div', { className: 'still' }, picture),
      make('p', { className: 'buttons' }, field, remove),
      make('p', { className: 'quiet', textContent: `${sends}${tracked && `, people tracked in ${tracked}`} · ${address}` }),
    );
    return tile;
  }

  /**
   * @param {string} path
   * @param {'PUT' | 'DELETE'} method
   * @param {object} [content]
   * @returns {Promise<boolean>} whether it was accepted
   */
  async #request(path, method, content) {
    try {
      this.update(await requestOperator(path, method, content));
      return true;
    } catch (error) {
      await requestOperator('setup').then(this.update, () => {}); // another page may have changed it
      this.showError(error);
      return false;
    }
  }
}
