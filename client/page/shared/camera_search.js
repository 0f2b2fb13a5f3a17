/** Cameras found in the network, their streams, and addresses: what is chosen is tried. */

import { element, make, setText } from './dom.js';
import { HttpError, requestOperator, requestTrial } from './requests.js';

/** @import {ShowWait} from './requests.js' */
/** @import {CameraTrial, OfferedStream, OfferedStreams, SearchResult, SearchedCamera} from './api_types.js' */

const SEARCH_TIMEOUT_MS = 30_000;

export class CameraSearch {
  #user = make('input', { id: 'camera-user', size: 14, maxLength: 200, autocomplete: 'off' });
  #password = make('input', { id: 'camera-password', type: 'password', size: 14, maxLength: 200, autocomplete: 'new-password' });
  #search = make('button', { id: 'search', type: 'button', textContent: 'Search the network' });
  #state = make('span', { id: 'search-state', className: 'quiet' });
  #address = addressField('address', 'rtsp://10.0.0.11/stream1');
  #substream = addressField('substream-address', 'none: people are tracked in the same');
  #trial = make('p', { id: 'trial-state', className: 'message' });
  #hint = '';

  /**
   * @param {HTMLElement} place what is in it applies to every camera, and comes after the login
   * @param {(trial: CameraTrial, showWait: ShowWait) => Promise<string>} tryCamera says what has become of a camera that sends pictures
   * @param {(error: unknown) => void} showError of the sign-in
   */
  constructor(place, tryCamera, showError) {
    this.tryCamera = tryCamera;
    this.showError = showError;
    const [login, found, address] = [this.#loginForm(), make('ul', { id: 'found', className: 'found' }), this.#addressForm()];
    found.setAttribute('aria-label', 'Cameras found');
    const search = make('p', { className: 'buttons' }, this.#search, ' ', this.#state);
    place.prepend(login, make('p', { className: 'quiet', textContent: 'Used for every camera below; leave empty where there is none.' }));
    place.append(search, found, address, this.#trial);
    for (const state of [this.#state, this.#trial]) state.setAttribute('role', 'status');
    this.#search.addEventListener('click', () => void this.run());
  }

  #loginForm() {
    const form = make('form', { id: 'login', className: 'buttons', autocomplete: 'off' });
    form.append(label(this.#user, 'Their user'), this.#user, label(this.#password, 'and password'), this.#password);
    form.addEventListener('submit', (event) => event.preventDefault());
    return form;
  }

  #addressForm() {
    const form = make('form', { id: 'address-form', className: 'buttons', autocomplete: 'off' });
    const parts = [label(this.#address, 'Or an address'), this.#address, label(this.#substream, 'and its substream'), this.#substream];
    form.append(...parts, make('button', { type: 'submit', textContent: 'Try' }));
    form.addEventListener('submit', async (event) => {
      event.preventDefault();
      const trial = { address: this.#address.value, substream_address: this.#substream.value, ...this.#login };
      if (await this.#try(this.#address.value, trial)) this.#address.value = this.#substream.value = '';
    });
    return form;
  }

  /** Search the network, and list the cameras that answer. */
  async run() {
    this.#search.disabled = true;
    setText(this.#state, 'Searching…');
    try {
      /** @type {SearchResult} */
      const { cameras, hint } = await requestOperator('setup/search', 'POST', undefined, SEARCH_TIMEOUT_MS);
      this.#hint = hint;
      element('found').replaceChildren(...cameras.map((camera) => this.#foundItem(camera)));
      const count = cameras.length ? `${cameras.length} found.` : 'None found by ONVIF. Enter their addresses.';
      setText(this.#state, cameras.length && hint ? `${count} ${hint}.` : count);
    } catch (error) {
      this.#fail(this.#state, error);
    }
    this.#search.disabled = false;
  }

  /** Forget the login, when the page is left. */
  forgetLogin() {
    this.#user.value = this.#password.value = '';
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
      const { error, streams, source, substream } = await requestTrial('setup/streams', { host, port, ...this.#login }, (wait) => setText(message, wait || 'Asking…'));
      setText(message, error ? `${host}: ${error}.` : '');
      const tracked = trackedChoice(camera, streams, substream);
      const first = streams.filter(({ key }) => key === source);
      const sorted = [...first, ...streams.filter(({ key }) => key !== source)];
      const buttons = sorted.map((stream) => this.#streamButton(camera, stream, tracked));
      list.replaceChildren(...buttons, ...(streams.length > 1 ? [make('label', {}, 'People are tracked in ', tracked)] : []));
    } catch (error) {
      this.#fail(message, error);
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
   * @param {CameraTrial} trial
   * @returns {Promise<boolean>} whether it sends pictures
   */
  async #try(label, trial) {
    const shown = label.replace(/\/\/[^/]*@/, '//'); // a login that was pasted with the address
    setText(this.#trial, `Trying ${shown}…`);
    try {
      const became = await this.tryCamera(trial, (wait) => setText(this.#trial, wait ? `${shown}: ${wait}` : `Trying ${shown}…`));
      setText(this.#trial, `${shown} sends pictures and ${became}.`);
      return true;
    } catch (error) {
      this.#fail(this.#trial, error);
      return false;
    }
  }

  /**
   * Say where it was tried why something failed: the top of the page may be out of sight.
   *
   * @param {Element} where
   * @param {unknown} error
   */
  #fail(where, error) {
    setText(where, error instanceof Error ? error.message : '');
    if (error instanceof HttpError && error.status === 401) this.showError(error);
  }
}

/**
 * @param {HTMLInputElement} field
 * @param {string} text
 */
function label(field, text) {
  return make('label', { htmlFor: field.id, textContent: text });
}

/**
 * @param {string} id
 * @param {string} placeholder
 */
function addressField(id, placeholder) {
  return make('input', { id, placeholder, className: 'address', maxLength: 1000, autocomplete: 'off', spellcheck: false, required: id === 'address' });
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
