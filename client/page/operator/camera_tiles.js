/** A tile for each camera with a current still and its diagnostics, and the clients of the pulse server. */

import { requestOperator } from '../shared/requests.js';
import { formatCameraProblem, formatMoment } from '../shared/camera_problem.js';
import { element, make, setText } from '../shared/dom.js';
import { Repeater } from './section.js';
import { CameraStills } from './camera_stills.js';

/** @import {CameraDiagnostics, PulseClients, Spread} from './api_types.js' */
/** @import {Section, ShowError} from './section.js' */
/** @import {Palette} from '../people/palette.js' */

const INTERVAL_MS = 1000; // as often as cameras send diagnostics
const NO_VALUE = '–';
/** @type {Record<CameraDiagnostics['state'], string>} */
const STATES = { live: 'Live', gone: 'Gone', ended: 'Ended', starting: 'Starting', refused: 'Refused' };

/** @type {Record<string, string>} what is wrong with the picture */
const CONDITIONS = { covered: 'Covered', turned: 'Turned away', blurred: 'Blurred', noisy: 'Dark', frozen: 'Frozen' };

/** @type {[string, string, (camera: CameraDiagnostics) => string][]} name, explanation, value */
const ROWS = [
  ['Rate', 'Frames taken per second', ({ fps }) => `${fps.toFixed(1)} fps`],
  ['Behind the pulse', 'From a pulse to its frame: median, worst', (camera) => formatSpread(camera.sync_error)],
  ['Pulses', 'Whether pulses come from the server', (camera) => (camera.synchronized ? 'synchronized' : 'not synchronized')],
  ['Clock', "The pulse server's clock minus the camera's", (camera) => formatSeconds(camera.clock_offset)],
  ['Tracking', 'From a pulse to its tracks: median, worst', (camera) => formatSpread(camera.tracking_delay)],
  ['Optimal', 'Windows whose solution is proven optimal', formatOptimal],
  ['Floor', 'How far from where the others see people it sees them; corrected', formatOffset],
  ['Missed', 'Pulses without a frame, since the start', ({ missed }) => String(missed)],
  ['Not searched', 'Frames not searched for people, since the start', ({ shed }) => String(shed)],
  ['Late', 'Windows that came after their views were decided', ({ late }) => String(late)],
];

/** @implements {Section} */
export class CameraTiles {
  /** @type {Map<string, CameraTile>} */
  #tiles = new Map();
  #repeater;
  #stills = new CameraStills();

  /**
   * @param {Palette} palette
   * @param {ShowError} showError
   */
  constructor(palette, showError) {
    this.palette = palette;
    this.#repeater = new Repeater(() => this.#refresh(), INTERVAL_MS, showError);
  }

  open() {
    this.#repeater.start();
    this.#stills.start();
  }

  close() {
    this.#repeater.stop();
    this.#stills.stop();
  }

  async #refresh() {
    const [{ cameras }, pulses] = await Promise.all([requestOperator('cameras'), requestOperator('pulses')]);
    for (const camera of /** @type {CameraDiagnostics[]} */ (cameras)) this.#tile(camera.camera).show(camera);
    showPulses(pulses);
  }

  /** @param {string} camera */
  #tile(camera) {
    const existing = this.#tiles.get(camera);
    if (existing) return existing;
    const tile = new CameraTile(camera, this.palette.color(camera));
    this.#tiles.set(camera, tile);
    element('camera-tiles').append(tile.item);
    this.#stills.add(camera, tile.image);
    return tile;
  }
}

class CameraTile {
  /**
   * @param {string} camera
   * @param {string} color
   */
  constructor(camera, color) {
    this.image = make('img', { alt: `What ${camera} sees now` });
    this.state = make('span', { className: 'state' });
    this.values = ROWS.map(([name, title]) => [make('dt', { textContent: name, title }), make('dd')]);
    this.error = make('p', { className: 'last-error' });
    const chip = make('span', { className: 'chip', textContent: camera });
    chip.style.setProperty('--camera', color);
    this.item = make(
      'li',
      { className: 'camera-tile' },
      make('div', { className: 'still' }, this.image),
      make('h3', {}, chip, this.state),
      make('dl', {}, ...this.values.flat()),
      this.error,
    );
  }

  /** @param {CameraDiagnostics} camera */
  show(camera) {
    this.item.dataset.state = camera.state;
    this.item.classList.toggle('unclear', camera.state === 'live' && (camera.condition in CONDITIONS || camera.covered_share > 0));
    setText(this.state, formatState(camera));
    ROWS.forEach(([, , format], at) => setText(this.values[at][1], format(camera)));
    setText(this.error, formatProblem(camera));
  }
}

/** @param {CameraDiagnostics} camera */
function formatState({ state, retry_at: retryAt, condition, condition_since: since, covered_share: covered }) {
  if (retryAt !== null) return 'Waiting';
  const wrong = state === 'live' ? CONDITIONS[condition] : undefined;
  if (wrong) return since ? `${wrong} since ${formatMoment(since)}` : wrong;
  if (state === 'live' && covered > 0) return `${Math.round(100 * covered)} % covered`;
  return STATES[state] ?? state;
}

/** @param {CameraDiagnostics} camera */
function formatProblem(camera) {
  const last = camera.last_error;
  return formatCameraProblem(camera) || (last ? `Last error, ${formatMoment(last.at)}: ${last.text}` : '');
}

/** @param {Spread | null} spread */
function formatSpread(spread) {
  return spread ? `${formatSeconds(spread.median)}, ${formatSeconds(spread.worst)}` : NO_VALUE;
}

/** @param {number | null} seconds */
function formatSeconds(seconds) {
  if (seconds === null) return NO_VALUE;
  return Math.abs(seconds) < 1 ? `${(seconds * 1000).toFixed(0)} ms` : `${seconds.toFixed(2)} s`;
}

/** @param {CameraDiagnostics} camera */
function formatOptimal({ optimal, solved_windows: windows }) {
  if (optimal === null) return NO_VALUE;
  return `${Math.floor(optimal * 1000) / 10} % of ${windows}`; // rounded down: 100 % only if all are
}

/** @param {CameraDiagnostics} camera */
function formatOffset({ floor_offset: meters }) {
  return meters === null ? NO_VALUE : `${meters.toFixed(2)} m`;
}

/** @param {PulseClients} pulses */
function showPulses({ server, error, clients, missing }) {
  const absent = missing.length ? ` Not connected: ${missing.join(', ')}.` : '';
  setText(element('pulses'), error ? `${error}.` : `${server} sends to ${clients.length} clients.${absent}`);
  const lines = clients.map(({ name, expected, behind }) => {
    const details = [expected || name === null ? '' : 'not of this site', behind ? `${behind} behind` : ''];
    return [name ?? 'unnamed client', details.filter(Boolean).join(', ')].filter(Boolean).join(': ');
  });
  const list = element('pulse-clients');
  if (lines.join('|') === [...list.children].map((item) => item.textContent).join('|')) return;
  list.replaceChildren(...lines.map((textContent) => make('li', { textContent })));
}
