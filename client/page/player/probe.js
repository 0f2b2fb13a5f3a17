/**
 * window.myview: the state of the page, for tests and benchmarks.
 *
 * @typedef {object} Delay
 * @property {number} pulse
 * @property {number} shownAt milliseconds, Date.now()
 * @property {number | null} delayMs from when the pulse was due until its frame is displayed
 */

/** @import {Box, Flag, Site} from '../shared/api_types.js' */
/** @import {State} from '../shared/status.js' */

const DELAYS_KEPT = 2048;
const EVENTS_KEPT = 512;

/**
 * @template T
 * @param {T[]} list
 * @param {T} entry
 * @param {number} capacity
 */
function push(list, entry, capacity) {
  list.push(entry);
  if (list.length > capacity) list.shift();
}

export class Probe {
  /** @type {Site | null} */
  site = null;
  /** @type {number | null} of the displayed frame */
  pulse = null;
  /** @type {number | null} the selected person */
  object = null;
  /** @type {string | null} the camera of the displayed frame */
  camera = null;
  /** @type {Box[]} in the displayed frame */
  boxes = [];
  /** @type {Flag[]} open, most urgent first */
  flags = [];
  /** @type {{object: number | null, accepted: number}} the person pointed at, and the number of accepted points */
  pointing = { object: null, accepted: 0 };
  /** @type {State} */
  state = 'starting';
  /** @type {Delay[]} of the last displayed frames, oldest first */
  delays = [];
  /** @type {{object: number, from: string, to: string, pulse: number, shownAt: number}[]} */
  cuts = [];
  /** @type {{object: number, chosenAt: number, shownAt: number | null}[]} Date.now() milliseconds */
  switches = [];

  /** @param {Delay} delay */
  frame(delay) {
    this.pulse = delay.pulse;
    push(this.delays, delay, DELAYS_KEPT);
  }

  /**
   * @param {number} object
   * @param {string | null} camera
   * @param {number} shownAt
   */
  view(object, camera, shownAt) {
    const from = this.camera;
    const last = this.switches.at(-1);
    const isSwitch = last?.shownAt === null && last.object === object;
    if (isSwitch) last.shownAt = shownAt;
    this.camera = camera;
    if (!isSwitch && from && camera && from !== camera && this.pulse !== null) {
      push(this.cuts, { object, from, to: camera, pulse: this.pulse, shownAt }, EVENTS_KEPT);
    }
  }

  /** @param {number} object */
  select(object) {
    this.object = object;
    push(this.switches, { object, chosenAt: Date.now(), shownAt: null }, EVENTS_KEPT);
  }
}
