/** Why a view was selected, in numbers: a table of the cameras at a displayed moment, or at one under the mouse. */

import { make } from '../shared/dom.js';
import { getJson } from '../shared/requests.js';

/** @import {Choice} from '../shared/api_types.js' */
/** @import {TimelineStrip} from '../timeline/strip.js' */
/** @import {Viewer} from '../viewer.js' */

/** @typedef {{key: string, object: number, pulse: number, time: string}} CostQuery */

const CACHE_SIZE = 200; // answers: more than the GOPs of a minute
const NUMBERS = new Intl.NumberFormat('en', { minimumFractionDigits: 2, maximumFractionDigits: 2 });
const SECONDS = new Intl.NumberFormat('en', { maximumFractionDigits: 2 });

/** Opens the table: by the Why button for the displayed view, by the mouse on the timeline for another. */
export class SelectionCosts {
  on = false;
  #decisions;

  /**
   * @param {Viewer} viewer
   * @param {TimelineStrip} strip
   * @param {HTMLElement} container
   */
  constructor(viewer, strip, container) {
    this.viewer = viewer;
    this.strip = strip;
    this.table = new CostTable(container);
    this.#decisions = viewer.decisions;
    const { canvas } = strip.surface;
    canvas.addEventListener('pointermove', ({ offsetX, pointerType }) => {
      if (pointerType === 'mouse') this.#show(strip.pulseAt(offsetX));
    });
    canvas.addEventListener('pointerleave', () => this.on || this.table.hide());
  }

  toggle() {
    this.on = !this.on;
    this.table.container.classList.toggle('stays', this.on);
    if (this.on) this.#show(this.viewer.probe.pulse);
    else this.table.hide();
  }

  /** Follow the displayed frame, unless the mouse is on the timeline. */
  update() {
    if (this.on && !this.strip.surface.canvas.matches(':hover')) this.#show(this.viewer.probe.pulse);
  }

  /** @param {number | null} pulse */
  #show(pulse) {
    const { site, object, probe, decisions } = this.viewer;
    if (decisions !== this.#decisions) this.table.clear(); // the pulses have restarted
    this.#decisions = decisions;
    if (!site || object === null || pulse === null || probe.pulse === null) return this.table.hide();
    const age = (probe.pulse - pulse) / site.fps;
    this.table.show(object, pulse, site.gop, age < site.gop / site.fps ? 'Now' : `${age.toFixed(1)} s before`);
  }
}

class CostTable {
  /** @type {Map<string, Choice>} by person and first pulse of the GOP */
  #cache = new Map();
  /** @type {CostQuery | null} null: hidden */
  #query = null;
  #requesting = false;

  /** @param {HTMLElement} container */
  constructor(container) {
    this.container = container;
  }

  hide() {
    this.#query = null;
    this.container.hidden = true;
  }

  clear() {
    this.#cache.clear();
  }

  /**
   * Called often; only the newest query is answered.
   *
   * @param {number} object
   * @param {number} pulse
   * @param {number} gop frames
   * @param {string} time label
   */
  show(object, pulse, gop, time) {
    const key = `${object} ${pulse - (pulse % gop)}`;
    this.#query = { key, object, pulse, time };
    const choice = this.#cache.get(key);
    if (choice) this.#draw(choice, time);
    else if (!this.#requesting) void this.#request(this.#query);
  }

  /** @param {CostQuery} query */
  async #request({ key, object, pulse }) {
    this.#requesting = true;
    try {
      const choice = /** @type {Choice} */ (await getJson(`api/objects/${object}/choice?at=p${pulse}`));
      this.#cache.set(key, choice);
      if (this.#cache.size > CACHE_SIZE) this.#cache.delete(/** @type {string} */ (this.#cache.keys().next().value));
      if (this.#query?.key === key) this.#draw(choice, this.#query.time);
    } catch {
      if (this.#query?.key === key) {
        this.#showText(`${this.#query.time}: not known. Reasons are kept from when a person is first watched.`);
      }
    }
    this.#requesting = false;
    const next = this.#query; // the mouse may have moved during the request
    if (next && next.key !== key && !this.#cache.has(next.key)) void this.#request(next);
  }

  /** @param {string} text */
  #showText(text) {
    this.container.replaceChildren(make('p', { textContent: text }));
    this.container.hidden = false;
  }

  /**
   * @param {Choice} choice
   * @param {string} time
   */
  #draw(choice, time) {
    const summary = `${time}: ${choice.camera ?? 'no camera'}. ${choice.reason}`;
    const [head, foot] = [summary, cutCosts(choice)].map((textContent) => make('p', { textContent }));
    this.container.replaceChildren(head, cameraTable(choice), foot);
    this.container.hidden = false;
  }
}

/** @param {Choice} choice */
function cameraTable(choice) {
  const terms = Object.keys(choice.weights);
  const { undetected = {} } = choice;
  const anyUndetected = Object.values(undetected).some((share) => share > 0);
  const columns = ['camera', 'cost', 'sees', ...(anyUndetected ? ['undetected'] : []), ...terms];
  const table = document.createElement('table');
  const head = table.createTHead().insertRow();
  head.append(...columns.map((textContent) => make('th', { textContent })));
  const body = table.createTBody();
  for (const [camera, cost] of Object.entries(choice.costs)) {
    const row = body.insertRow();
    if (camera === choice.camera) row.setAttribute('aria-current', 'true');
    const shares = anyUndetected ? [choice.seen[camera], undetected[camera]] : [choice.seen[camera]];
    const values = [cost, ...shares, ...terms.map((term) => choice.terms[camera]?.[term])];
    const cells = values.map((value) => make('td', { textContent: formatNumber(value) }));
    row.append(make('th', { textContent: camera }), ...cells);
  }
  return table;
}

/** @param {Choice} choice */
function cutCosts({ before, stay_s: stay, cut_to: to, cut_s: cut, switch_cost_s: cutCost, lookahead_s: ahead }) {
  const text = `A cut costs as much as ${SECONDS.format(cutCost)} s of not seeing the person.`;
  const costs = [];
  if (before !== null && stay !== null) costs.push(`staying with ${before} ${SECONDS.format(stay)} s`);
  if (to !== null && cut !== null) costs.push(`${to} ${SECONDS.format(cut)} s with its cut`);
  return costs.length ? `${text} Over ${SECONDS.format(ahead)} s: ${costs.join(', ')}.` : text;
}

/** @param {number | null | undefined} value */
function formatNumber(value) {
  return value === null || value === undefined ? '–' : NUMBERS.format(value);
}
