/** Why a view was chosen, in numbers: a table of the cameras at one moment of the last minute. */

import { getJson } from '../shared/requests.js';

/** @import {Choice} from '../shared/contract.js' */

/** @typedef {{key: string, object: number, pulse: number, when: string}} Wish */

const KEPT = 200; // answers: a minute of GOPs, and some
const NUMBERS = new Intl.NumberFormat('en', { minimumFractionDigits: 2, maximumFractionDigits: 2 });
const FRAMES = new Intl.NumberFormat('en', { maximumFractionDigits: 1 });

export class Why {
  /** @type {Map<string, Choice>} by person and first pulse of the GOP */
  #known = new Map();
  /** @type {Wish | null} null: nothing is to be shown */
  #wanted = null;
  #asking = false;

  /** @param {HTMLElement} place */
  constructor(place) {
    this.place = place;
  }

  hide() {
    this.#wanted = null;
    this.place.hidden = true;
  }

  /** Pulses began anew: their numbers mean other moments. */
  forget() {
    this.#known.clear();
  }

  /**
   * Called often; only the newest wish is answered.
   *
   * @param {number} object
   * @param {number} pulse
   * @param {number} gop frames
   * @param {string} when in words
   */
  show(object, pulse, gop, when) {
    const key = `${object} ${pulse - (pulse % gop)}`;
    this.#wanted = { key, object, pulse, when };
    const known = this.#known.get(key);
    if (known) this.#draw(known, when);
    else if (!this.#asking) void this.#ask(this.#wanted);
  }

  /** @param {Wish} wish */
  async #ask({ key, object, pulse }) {
    this.#asking = true;
    try {
      const choice = /** @type {Choice} */ (await getJson(`api/objects/${object}/choice?at=p${pulse}`));
      this.#known.set(key, choice);
      if (this.#known.size > KEPT) this.#known.delete(/** @type {string} */ (this.#known.keys().next().value));
      if (this.#wanted?.key === key) this.#draw(choice, this.#wanted.when);
    } catch {
      if (this.#wanted?.key === key) {
        this.#say(`${this.#wanted.when}: not known. Reasons are kept from when a person is first watched.`);
      }
    }
    this.#asking = false;
    const next = this.#wanted; // somebody may have gone on meanwhile, and rest there
    if (next && next.key !== key && !this.#known.has(next.key)) void this.#ask(next);
  }

  /** @param {string} text */
  #say(text) {
    this.place.replaceChildren(made('p', text));
    this.place.hidden = false;
  }

  /**
   * @param {Choice} choice
   * @param {string} when
   */
  #draw(choice, when) {
    const words = `${when}: ${choice.camera ?? 'no camera'}. ${choice.reason}`;
    this.place.replaceChildren(made('p', words), table(choice), made('p', prices(choice)));
    this.place.hidden = false;
  }
}

/** @param {Choice} choice */
function table(choice) {
  const terms = Object.keys(choice.weights);
  const { undetected = {} } = choice;
  const some = Object.values(undetected).some((share) => share > 0);
  const views = document.createElement('table');
  const head = views.createTHead().insertRow();
  head.append(...['camera', 'cost', 'sees', ...(some ? ['undetected'] : []), ...terms].map((name) => made('th', name)));
  const body = views.createTBody();
  for (const [camera, cost] of Object.entries(choice.costs)) {
    const row = body.insertRow();
    if (camera === choice.camera) row.setAttribute('aria-current', 'true');
    const shares = some ? [choice.seen[camera], undetected[camera]] : [choice.seen[camera]];
    const values = [cost, ...shares, ...terms.map((term) => choice.terms[camera]?.[term])];
    row.append(made('th', camera), ...values.map((value) => made('td', number(value))));
  }
  return views;
}

/** @param {Choice} choice */
function prices({ before, stay, cut_to: to, cut, switch_cost: price, lookahead }) {
  const words = `A cut costs as much as ${FRAMES.format(price)} frames of not seeing the person.`;
  const costs = [];
  if (before !== null && stay !== null) costs.push(`staying with ${before} ${FRAMES.format(stay)}`);
  if (to !== null && cut !== null) costs.push(`${to} ${FRAMES.format(cut)} with its cut`);
  return costs.length ? `${words} Over ${lookahead} frames: ${costs.join(', ')}.` : words;
}

/** @param {number | null | undefined} value */
function number(value) {
  return value === null || value === undefined ? '–' : NUMBERS.format(value);
}

/**
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} name
 * @param {string} text
 */
function made(name, text) {
  const element = document.createElement(name);
  element.textContent = text;
  return element;
}
