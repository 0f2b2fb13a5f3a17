/** Cameras found in the network, their streams, and addresses: what is chosen is tried. */

import { element, make, onClick, setChildren, setText } from './dom.js';
import { HttpError, followTrial, requestOperator, requestTrial } from './requests.js';
import { TrialLines } from './trial_lines.js';
import { forgetTrial, rememberTrial, runningTrials } from './running_trials.js';

/** @import {ShowWait} from './requests.js' */
/** @import {TrialAim} from './running_trials.js' */
/** @import {CameraTrial, OfferedStream, OfferedStreams, SearchResult, SearchedCamera} from './api_types.js' */

const SEARCH_TIMEOUT_MS = 30_000;

/**
 * What is done with cameras that are tried.
 *
 * @typedef {object} TrialTarget
 * @property {string} path of the request, below api/operator/
 * @property {(trial: CameraTrial) => CameraTrial & TrialAim} request its JSON
 * @property {(answer: any, aim: TrialAim) => Promise<string>} showResult shows the answer; says what has become of the camera
 * @property {() => void} [refused] called when a trial fails or its camera is refused
 */

export class CameraSearch {
  #user = make('input', { id: 'camera-user', size: 14, maxLength: 200, autocomplete: 'off' });
  #password = make('input', { id: 'camera-password', type: 'password', size: 14, maxLength: 200, autocomplete: 'new-password' });
  #search = make('button', { id: 'search', type: 'button', textContent: 'Search the network' });
  #state = make('span', { id: 'search-state', className: 'quiet' });
  #address = addressField('address', 'rtsp://10.0.0.11/stream1');
  #substream = addressField('substream-address', 'none: people are tracked in the same');
  #trials = new TrialLines('Trials of addresses');
  /** @type {Map<string, {item: HTMLElement, trials: TrialLines}>} by address and port */
  #found = new Map();
  #hint = '';

  /**
   * @param {HTMLElement} place what is in it applies to every camera, and comes after the login
   * @param {TrialTarget} target
   * @param {(error: unknown) => void} showError of the sign-in
   */
  constructor(place, target, showError) {
    this.target = target;
    this.showError = showError;
    const [login, found, address] = [this.#loginForm(), make('ul', { id: 'found', className: 'found' }), this.#addressForm()];
    found.setAttribute('aria-label', 'Cameras found');
    const search = make('p', { className: 'buttons' }, this.#search, ' ', this.#state);
    place.prepend(login, make('p', { className: 'quiet', textContent: 'Used for every camera below; leave empty where there is none.' }));
    place.append(search, found, address, this.#trials.list);
    this.#state.setAttribute('role', 'status');
    onClick(this.#search, () => this.run());
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
      const [address, substream] = [this.#address.value, this.#substream.value];
      const works = await this.#try(address, { address, substream_address: substream, ...this.#login }, this.#trials);
      if (works && this.#address.value === address) this.#address.value = ''; // else another one was entered meanwhile
      if (works && this.#substream.value === substream) this.#substream.value = '';
    });
    return form;
  }

  /** Search the network, and list the cameras that answer. */
  async run() {
    setText(this.#state, 'Searching…');
    try {
      /** @type {SearchResult} */
      const { cameras, hint } = await requestOperator('setup/search', 'POST', undefined, SEARCH_TIMEOUT_MS);
      this.#hint = hint;
      this.#list(cameras);
      const count = cameras.length ? `${cameras.length} found.` : 'None found by ONVIF. Enter their addresses.';
      setText(this.#state, cameras.length && hint ? `${count} ${hint}.` : count);
    } catch (error) {
      setText(this.#state, this.#explain(error));
    }
  }

  /**
   * List cameras that were found, and those of earlier searches that were tried: one may be tried now.
   *
   * @param {SearchedCamera[]} cameras
   */
  #list(cameras) {
    const found = new Map(cameras.map((camera) => [`${camera.host}:${camera.port}`, camera]));
    for (const [key, { trials }] of this.#found) if (!found.has(key) && trials.empty) this.#found.delete(key);
    for (const [key, camera] of found) if (!this.#found.has(key)) this.#found.set(key, this.#foundItem(camera));
    setChildren(element('found'), [...this.#found.values()].map(({ item }) => item));
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
    const trials = new TrialLines(`Trials of ${camera.name || camera.host}`);
    const message = make('p', { className: 'quiet' });
    message.setAttribute('role', 'status');
    const ask = make('button', { type: 'button', textContent: this.#hint ? 'Enter its address' : 'Show its streams' });
    ask.setAttribute('aria-label', `${ask.textContent}: ${label}`);
    onClick(ask, async () => {
      if (this.#hint) this.#proposeAddress(camera.host);
      else await this.#askStreams(camera, streams, message, trials);
    });
    const head = make('p', { className: 'buttons' }, make('span', { textContent: label }), ask);
    return { item: make('li', {}, head, streams, message, trials.list), trials };
  }

  /** @param {string} host */
  #proposeAddress(host) {
    this.#address.value = `rtsp://${host}/`;
    this.#address.focus();
  }

  /**
   * @param {SearchedCamera} camera
   * @param {HTMLElement} list
   * @param {HTMLElement} message
   * @param {TrialLines} trials
   */
  async #askStreams(camera, list, message, trials) {
    setText(message, 'Asking…');
    try {
      const { host, port } = camera;
      /** @type {OfferedStreams} */
      const { error, streams, source, substream } = await requestTrial('setup/streams', { host, port, ...this.#login }, (wait) => setText(message, wait || 'Asking…'));
      setText(message, error ? `${host}: ${error}.` : `${streams.length} ${streams.length > 1 ? 'streams' : 'stream'}.`);
      const tracked = trackedChoice(camera, streams, substream);
      const first = streams.filter(({ key }) => key === source);
      const sorted = [...first, ...streams.filter(({ key }) => key !== source)];
      const buttons = sorted.map((stream) => this.#streamButton(camera, stream, tracked, trials));
      list.replaceChildren(...buttons, ...(streams.length > 1 ? [make('label', {}, 'People are tracked in ', tracked)] : []));
    } catch (error) {
      setText(message, this.#explain(error));
    }
  }

  /**
   * @param {SearchedCamera} camera
   * @param {OfferedStream} offered
   * @param {HTMLSelectElement} tracked
   * @param {TrialLines} trials
   */
  #streamButton({ host, name }, offered, tracked, trials) {
    const { key, name: stream } = offered;
    const button = make('button', { type: 'button', textContent: `Try ${describeStream(offered)}` });
    onClick(button, async () => {
      const chosen = Number(tracked.value);
      const substream = chosen && chosen !== key ? chosen : null;
      await this.#try(`${host} ${stream}`, { stream: key, substream, name: name || host }, trials);
    });
    return button;
  }

  /**
   * @param {string} label
   * @param {CameraTrial} trial
   * @param {TrialLines} trials
   * @returns {Promise<boolean>} whether it sends pictures
   */
  async #try(label, trial, trials) {
    const shown = label.trim().replace(/\/\/.*@/, '//'); // a login that was pasted with the address
    const wanted = this.target.request(trial);
    const aim = { camera: wanted.camera, name: wanted.name };
    let key = NaN;
    const works = await this.#report(shown, trials, aim, (showWait) =>
      requestTrial(this.target.path, wanted, showWait, (begun) => rememberTrial((key = begun), { shown, ...aim })),
    );
    forgetTrial(key);
    return works;
  }

  /** Go on to report the trials that ran when this page was left or reloaded. */
  resume() {
    for (const { trial, shown, ...aim } of runningTrials()) {
      void this.#report(shown, this.#trials, aim, (showWait) => followTrial({ trial, ahead: 0 }, showWait)).then(() => forgetTrial(trial));
    }
  }

  /**
   * @param {string} shown
   * @param {TrialLines} trials
   * @param {TrialAim} aim
   * @param {(showWait: ShowWait) => Promise<any>} run
   * @returns {Promise<boolean>} whether it sends pictures
   */
  async #report(shown, trials, aim, run) {
    const show = trials.begin(shown);
    show(`Trying ${shown}…`);
    try {
      const answer = await run((wait) => show(wait ? `${shown}: ${wait}` : `Trying ${shown}…`));
      show(`${shown} sends pictures and ${await this.target.showResult(answer, aim)}.`, true);
      return true;
    } catch (error) {
      const why = this.#explain(error);
      this.target.refused?.();
      show(`${shown}: ${why.replace(/^\w+:\/\/\S+: /, '')}`, true); // without the address, of which the server shows less
      return false;
    }
  }

  /**
   * Return why something failed, to say it where it was tried: the top of the page may be out of sight.
   *
   * @param {unknown} error
   */
  #explain(error) {
    if (error instanceof HttpError && error.status === 401) this.showError(error);
    return error instanceof Error ? error.message : '';
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
