/** Cameras found in the network, their streams, and addresses: each is tried before it is added. */

import { element, make, setText } from '../shared/dom.js';
import { requestOperator } from '../shared/requests.js';

/** @import {OfferedStream, OfferedStreams, SearchResult, SearchedCamera, SetupState} from './api_types.js' */

const CAMERA_TIMEOUT_MS = 120_000; // a busy machine tries cameras one after the other

export class CameraSearch {
  /** @type {HTMLButtonElement} */
  #search = element('search');
  /** @type {HTMLInputElement} */
  #user = element('camera-user');
  /** @type {HTMLInputElement} */
  #password = element('camera-password');
  /** @type {HTMLInputElement} */
  #address = element('address');
  /** @type {HTMLInputElement} */
  #substream = element('substream-address');
  #state = element('search-state');
  #trial = element('trial-state');
  #hint = '';

  /**
   * @param {(state: SetupState) => void} show
   * @param {(error: unknown) => void} showError null: no error
   */
  constructor(show, showError) {
    this.show = show;
    this.showError = showError;
    this.#search.addEventListener('click', () => void this.run());
    element('login').addEventListener('submit', (event) => event.preventDefault());
    element('address-form').addEventListener('submit', async (event) => {
      event.preventDefault();
      const trial = { address: this.#address.value, substream_address: this.#substream.value, ...this.#login };
      if (await this.#try(this.#address.value, trial)) this.#address.value = this.#substream.value = '';
    });
  }

  /** Search the network, and list the cameras that answer. */
  async run() {
    this.#search.disabled = true;
    setText(this.#state, 'Searching…');
    try {
      /** @type {SearchResult} */
      const { cameras, hint } = await requestOperator('setup/search', 'POST', undefined, CAMERA_TIMEOUT_MS);
      this.#hint = hint;
      element('found').replaceChildren(...cameras.map((camera) => this.#foundItem(camera)));
      const count = cameras.length ? `${cameras.length} found.` : 'None found by ONVIF. Enter their addresses.';
      setText(this.#state, cameras.length && hint ? `${count} ${hint}.` : count);
    } catch (error) {
      setText(this.#state, '');
      this.showError(error);
    }
    this.#search.disabled = false;
  }

  get #login() {
    return { user: this.#user.value, password: this.#password.value };
  }

  /** @param {SearchedCamera} camera */
  #foundItem(camera) {
    const label = [camera.host, camera.name, camera.hardware && `(${camera.hardware})`].filter(Boolean).join(' ');
    const streams = make('p', { className: 'buttons' });
    const message = make('p', { className: 'quiet' });
    message.setAttribute('role', 'status');
    const ask = make('button', { type: 'button', textContent: this.#hint ? 'Enter its address' : 'Show its streams' });
    ask.setAttribute('aria-label', `${ask.textContent}: ${label}`);
    ask.addEventListener('click', () => {
      if (this.#hint) this.#proposeAddress(camera.host);
      else void this.#askStreams(camera, ask, streams, message);
    });
    return make('li', {}, make('p', { className: 'buttons' }, make('span', { textContent: label }), ask), streams, message);
  }

  /** @param {string} host */
  #proposeAddress(host) {
    this.#address.value = `rtsp://${host}/`;
    this.#address.focus();
  }

  /**
   * @param {SearchedCamera} camera
   * @param {HTMLButtonElement} ask
   * @param {HTMLElement} list
   * @param {HTMLElement} message
   */
  async #askStreams(camera, ask, list, message) {
    ask.disabled = true;
    setText(message, 'Asking…');
    try {
      const { host, port } = camera;
      /** @type {OfferedStreams} */
      const { error, streams, source, substream } = await requestOperator('setup/streams', 'POST', { host, port, ...this.#login }, CAMERA_TIMEOUT_MS);
      setText(message, error ? `${host}: ${error}.` : '');
      const tracked = trackedChoice(camera, streams, substream);
      const first = streams.filter(({ key }) => key === source);
      const sorted = [...first, ...streams.filter(({ key }) => key !== source)];
      const buttons = sorted.map((stream) => this.#streamButton(camera, stream, tracked));
      list.replaceChildren(...buttons, ...(streams.length > 1 ? [make('label', {}, 'People are tracked in ', tracked)] : []));
      this.showError(null);
    } catch (error) {
      setText(message, '');
      this.showError(error);
    }
    ask.disabled = false;
  }

  /**
   * @param {SearchedCamera} camera
   * @param {OfferedStream} offered
   * @param {HTMLSelectElement} tracked
   */
  #streamButton({ host, name }, offered, tracked) {
    const { key, name: stream } = offered;
    const button = make('button', { type: 'button', textContent: `Try ${describeStream(offered)}` });
    button.addEventListener('click', async () => {
      button.disabled = true;
      const chosen = Number(tracked.value);
      const substream = chosen && chosen !== key ? chosen : null;
      await this.#try(`${host} ${stream}`, { stream: key, substream, name: name || host });
      button.disabled = false;
    });
    return button;
  }

  /**
   * @param {string} label
   * @param {object} trial
   * @returns {Promise<boolean>} whether it was added
   */
  async #try(label, trial) {
    const shown = label.replace(/\/\/[^/]*@/, '//'); // a login that was pasted with the address
    setText(this.#trial, `Trying ${shown}…`);
    try {
      this.show(await requestOperator('setup/cameras', 'POST', trial, CAMERA_TIMEOUT_MS));
      setText(this.#trial, `${shown} sends pictures and was added.`);
      return true;
    } catch (error) {
      setText(this.#trial, '');
      this.showError(error);
      return false;
    }
  }
}

/** @param {OfferedStream} stream */
function describeStream({ name, codec, width, height, fps }) {
  return `${name}: ${codec} ${width}×${height}${fps ? `, ${fps} fps` : ''}`;
}

/**
 * Choice of the stream in which people are tracked; 0: the one that viewers get.
 *
 * @param {SearchedCamera} camera
 * @param {OfferedStream[]} streams
 * @param {number | null} proposed
 */
function trackedChoice({ host }, streams, proposed) {
  const options = streams.map((stream) => make('option', { value: String(stream.key), textContent: describeStream(stream) }));
  const choice = make('select', {}, make('option', { value: '0', textContent: 'the stream that is tried' }), ...options);
  choice.value = String(proposed ?? 0);
  choice.setAttribute('aria-label', `Stream of ${host} in which people are tracked`);
  return choice;
}
