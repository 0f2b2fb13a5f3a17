/** Downloads of a time span: tables, cameras and best views. */

import { getJson } from '../shared/requests.js';
import { longLabel } from '../people/names.js';
import { element, make, setText } from '../shared/dom.js';

/** @import {Person, Site} from '../shared/api_types.js' */
/** @import {Section} from './section.js' */

const DEFAULT_SPAN_MS = 60_000;

/** @implements {Section} */
export class Downloads {
  /** @type {Person[]} */
  #people = [];
  /** @type {HTMLInputElement} */
  #from = element('span-from');
  /** @type {HTMLInputElement} */
  #to = element('span-to');

  /** @param {Site} site */
  constructor(site) {
    this.site = site;
    for (const input of [this.#from, this.#to]) input.addEventListener('input', () => this.#updateLinks());
    element('last-minute').addEventListener('click', () => this.#lastMinute());
    this.#lastMinute();
  }

  open() {
    void this.#showRecordedSince();
  }

  close() {}

  /** @param {Person[]} people */
  show(people) {
    const known = people.map(({ object, name }) => `${object} ${name}`).join('|');
    if (known === this.#people.map(({ object, name }) => `${object} ${name}`).join('|')) return;
    this.#people = people;
    this.#updateLinks();
  }

  #lastMinute() {
    const now = new Date();
    this.#to.value = local(now);
    this.#from.value = local(new Date(now.getTime() - DEFAULT_SPAN_MS));
    this.#updateLinks();
  }

  async #showRecordedSince() {
    const requests = this.site.cameras.map(async (camera) => {
      const { spans } = await getJson(`api/cameras/${camera}/past`).catch(() => ({ spans: [] }));
      return /** @type {{frames: number, begins: string | null}[]} */ (spans);
    });
    const spans = (await Promise.all(requests)).flat();
    const starts = spans.map(({ begins }) => begins).filter((time) => time !== null).sort();
    const since = starts.length ? new Date(starts[0]).toLocaleString() : '';
    setText(element('downloads-kept'), since ? `Recorded since ${since}.` : 'Nothing is recorded yet.');
  }

  #updateLinks() {
    const [from, to] = [this.#from, this.#to].map(({ value }) => (value ? new Date(value) : null));
    const valid = from !== null && to !== null && from < to;
    this.#to.setCustomValidity(valid ? '' : 'The end is not after the start.');
    this.#to.setAttribute('aria-invalid', String(!valid));
    const span = valid ? `?from=${from.toISOString()}&to=${to.toISOString()}` : '';
    const container = this.site.container ?? 'mp4';
    /** @type {[string, [string, string][]][]} */
    const lists = [
      ['download-tables', [['Tracks (CSV)', 'api/operator/tracks.csv'], ['Choices (CSV)', 'api/operator/choices.csv']]],
      ['download-cameras', this.site.cameras.map((camera) => [camera, `cameras/${camera}/live.mp4`])],
      ['download-people', this.#people.map(({ object }) => [longLabel(object), `objects/${object}/best.mp4`])],
    ];
    for (const [list, files] of lists) {
      const available = span && (container === 'mp4' || list === 'download-tables');
      const links = available ? files.map((file) => make('li', {}, this.#downloadLink(file, span))) : [];
      element(list).replaceChildren(...links);
      if (!links.length) element(list).append(make('li', { className: 'quiet', textContent: available ? 'No people' : unavailableReason(valid) }));
    }
  }

  /**
   * @param {[string, string]} file label and address
   * @param {string} span
   */
  #downloadLink([label, address], span) {
    const stamp = this.#from.value.replace(/:/g, '');
    const name = address.includes('.csv') ? '' : `${this.site.name}-${label.replace(/[^\w-]+/g, '-')}-${stamp}.mp4`;
    return make('a', { href: address + span, download: name, textContent: label });
  }
}

/** @param {boolean} valid */
function unavailableReason(valid) {
  return valid ? 'VP8 is not recorded.' : 'The end is not after the start.';
}

/**
 * Format a time for the input element: local time without a time zone.
 *
 * @param {Date} moment
 */
function local(moment) {
  const shifted = new Date(moment.getTime() - moment.getTimezoneOffset() * 60_000);
  return shifted.toISOString().slice(0, 19);
}
