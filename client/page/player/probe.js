/**
 * window.myview: what the page shows, for tests and benchmarks to read.
 *
 * @typedef {object} Delay
 * @property {number} pulse
 * @property {number} shownAt milliseconds, Date.now()
 * @property {number | null} delayMs from the moment the pulse was due to the moment its frame is shown
 */

/** @import {Box, Flag, Site} from '../shared/contract.js' */
/** @import {State} from '../shared/status.js' */

const DELAYS_KEPT = 2048;
const EVENTS_KEPT = 512;

/**
 * @template T
 * @param {T[]} list
 * @param {T} entry
 * @param {number} most
 */
function keep(list, entry, most) {
  list.push(entry);
  if (list.length > most) list.shift();
}

export class Probe {
  /** @type {Site | null} */
  site = null;
  /** @type {number | null} the frame now shown */
  pulse = null;
  /** @type {number | null} the chosen person */
  object = null;
  /** @type {string | null} the camera whose frame is shown */
  camera = null;
  /** @type {Box[]} in it */
  boxes = [];
  /** @type {Flag[]} that can be answered, the most urgent first */
  flags = [];
  /** @type {{object: number | null, taken: number}} whom the operator points at, and how many places were taken */
  pointing = { object: null, taken: 0 };
  /** @type {State} */
  state = 'starting';
  /** @type {Delay[]} of the last frames shown, oldest first */
  delays = [];
  /** @type {{object: number, from: string, to: string, pulse: number, shownAt: number}[]} as shown */
  cuts = [];
  /** @type {{object: number, chosenAt: number, shownAt: number | null}[]} Date.now() milliseconds */
  switches = [];

  /** @param {Delay} delay */
  frame(delay) {
    this.pulse = delay.pulse;
    keep(this.delays, delay, DELAYS_KEPT);
  }

  /**
   * @param {number} object
   * @param {string | null} camera
   * @param {number} shownAt
   */
  view(object, camera, shownAt) {
    const from = this.camera;
    const last = this.switches.at(-1);
    const fresh = last?.shownAt === null && last.object === object;
    if (fresh) last.shownAt = shownAt;
    this.camera = camera;
    if (!fresh && from && camera && from !== camera && this.pulse !== null) {
      keep(this.cuts, { object, from, to: camera, pulse: this.pulse, shownAt }, EVENTS_KEPT);
    }
  }

  /** @param {number} object */
  choose(object) {
    this.object = object;
    keep(this.switches, { object, chosenAt: Date.now(), shownAt: null }, EVENTS_KEPT);
  }
}
