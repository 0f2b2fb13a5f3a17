/** The cameras, each on a tile: a picture of now, and what is measured. Below, who listens to the pulses. */

import { ask } from './requests.js';
import { element, make, put, Repeated } from './section.js';
import { Stills } from './stills.js';

/** @import {CameraDiagnostics, Pulses, Spread} from './contract.js' */
/** @import {Section, Tell} from './section.js' */
/** @import {Palette} from '../people/palette.js' */

const EVERY_MS = 1000; // cameras say how they are once a second
const NOTHING = '–';
/** @type {Record<CameraDiagnostics['state'], string>} */
const STATES = { live: 'Live', gone: 'Gone', ended: 'Ended', starting: 'Starting', refused: 'Refused' };

/** @type {[string, string, (camera: CameraDiagnostics) => string][]} what a tile says: name, what it means, value */
const ROWS = [
  ['Rate', 'Frames taken per second', (it) => `${it.fps.toFixed(1)} fps`],
  ['Behind the pulse', 'From a pulse to its frame: median, worst', (it) => spread(it.sync_error)],
  ['Pulses', 'Whether pulses come from the server', (it) => (it.synchronized ? 'synchronized' : 'not synchronized')],
  ['Clock', "The pulse server's clock minus the camera's", (it) => seconds(it.clock_offset)],
  ['Tracking', 'From a pulse to its tracks: median, worst', (it) => spread(it.tracking_delay)],
  ['Optimal', 'Windows whose solution is proven optimal', optimalShare],
  ['Missed', 'Pulses without a frame, since the start', (it) => String(it.missed)],
  ['Not searched', 'Frames not searched for people, since the start', (it) => String(it.shed)],
  ['Late', 'Windows that came after their views were decided', (it) => String(it.late)],
];

/** @implements {Section} */
export class CameraTiles {
  /** @type {Map<string, Tile>} */
  #tiles = new Map();
  #repeated;
  #stills = new Stills();

  /**
   * @param {Palette} palette
   * @param {Tell} tell
   */
  constructor(palette, tell) {
    this.palette = palette;
    this.#repeated = new Repeated(() => this.#look(), EVERY_MS, tell);
  }

  open() {
    this.#repeated.start();
    this.#stills.start();
  }

  close() {
    this.#repeated.stop();
    this.#stills.stop();
  }

  async #look() {
    const [{ cameras }, pulses] = await Promise.all([ask('cameras'), ask('pulses')]);
    for (const camera of /** @type {CameraDiagnostics[]} */ (cameras)) this.#tile(camera.camera).show(camera);
    showPulses(pulses);
  }

  /** @param {string} camera */
  #tile(camera) {
    const known = this.#tiles.get(camera);
    if (known) return known;
    const tile = new Tile(camera, this.palette.colour(camera));
    this.#tiles.set(camera, tile);
    element('camera-tiles').append(tile.item);
    this.#stills.add(camera, tile.image);
    return tile;
  }
}

class Tile {
  /**
   * @param {string} camera
   * @param {string} colour
   */
  constructor(camera, colour) {
    this.image = make('img', { alt: `What ${camera} sees now` });
    this.state = make('span', { className: 'state' });
    this.values = ROWS.map(([name, title]) => [make('dt', { textContent: name, title }), make('dd')]);
    this.trouble = make('p', { className: 'last-trouble' });
    const chip = make('span', { className: 'chip', textContent: camera });
    chip.style.setProperty('--camera', colour);
    this.item = make(
      'li',
      { className: 'camera-tile' },
      make('div', { className: 'still' }, this.image),
      make('h3', {}, chip, this.state),
      make('dl', {}, ...this.values.flat()),
      this.trouble,
    );
  }

  /** @param {CameraDiagnostics} camera */
  show(camera) {
    this.item.dataset.state = camera.state;
    put(this.state, STATES[camera.state] ?? camera.state);
    ROWS.forEach(([, , value], at) => put(this.values[at][1], value(camera)));
    put(this.trouble, camera.message || past(camera));
  }
}

/** @param {CameraDiagnostics} camera */
function past({ last_error: last }) {
  if (!last) return '';
  const at = new Date(last.at * 1000);
  const now = new Date();
  const day = at.toDateString() === now.toDateString() ? '' : `${at.toLocaleDateString()} `;
  return `Last, at ${day}${at.toLocaleTimeString()}: ${last.text}`;
}

/** @param {Spread | null} values */
function spread(values) {
  return values ? `${seconds(values.median)}, ${seconds(values.worst)}` : NOTHING;
}

/** @param {number | null} value */
function seconds(value) {
  if (value === null) return NOTHING;
  return Math.abs(value) < 1 ? `${(value * 1000).toFixed(0)} ms` : `${value.toFixed(2)} s`;
}

/** @param {CameraDiagnostics} camera */
function optimalShare(camera) {
  if (camera.optimal === null) return NOTHING;
  return `${Math.floor(camera.optimal * 1000) / 10} % of ${camera.solved_windows}`; // 100 % only where all are
}

/** @param {Pulses} pulses */
function showPulses({ server, error, clients, missing }) {
  const absent = missing.length ? ` Not there: ${missing.join(', ')}.` : '';
  put(element('pulses'), error ? `${error}.` : `${server} sends them to ${clients.length}.${absent}`);
  const words = clients.map(({ name, expected, behind }) => {
    const who = name ?? 'a listener without a name';
    const what = [expected || name === null ? '' : 'not of this site', behind ? `${behind} behind` : ''];
    return [who, what.filter(Boolean).join(', ')].filter(Boolean).join(': ');
  });
  const list = element('pulse-clients');
  if (words.join('|') === [...list.children].map((it) => it.textContent).join('|')) return;
  list.replaceChildren(...words.map((it) => make('li', { textContent: it })));
}
