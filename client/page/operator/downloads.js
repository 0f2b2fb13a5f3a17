/** What is kept of a time span, to download: tables from the operator's addresses, pictures from everybody's. */

import { getJson } from '../shared/requests.js';
import { person } from '../people/names.js';
import { element, make, put } from './section.js';

/** @import {Person, Site} from '../shared/contract.js' */
/** @import {Section} from './section.js' */

const SPAN_MS = 60_000;

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
    for (const input of [this.#from, this.#to]) input.addEventListener('input', () => this.#link());
    element('last-minute').addEventListener('click', () => this.#lastMinute());
    this.#lastMinute();
  }

  open() {
    void this.#tellWhatIsKept();
  }

  close() {}

  /** @param {Person[]} people */
  show(people) {
    const known = people.map(({ object, name }) => `${object} ${name}`).join('|');
    if (known === this.#people.map(({ object, name }) => `${object} ${name}`).join('|')) return;
    this.#people = people;
    this.#link();
  }

  #lastMinute() {
    const now = new Date();
    this.#to.value = local(now);
    this.#from.value = local(new Date(now.getTime() - SPAN_MS));
    this.#link();
  }

  async #tellWhatIsKept() {
    const asked = this.site.cameras.map(async (camera) => {
      const { spans } = await getJson(`api/cameras/${camera}/past`).catch(() => ({ spans: [] }));
      return /** @type {{frames: number, begins: string | null}[]} */ (spans);
    });
    const spans = (await Promise.all(asked)).flat();
    const begins = spans.map(({ begins: it }) => it).filter((it) => it !== null).sort();
    const since = begins.length ? new Date(begins[0]).toLocaleString() : '';
    put(element('downloads-kept'), since ? `Recorded since ${since}.` : 'Nothing is recorded yet.');
  }

  #link() {
    const [from, to] = [this.#from, this.#to].map(({ value }) => (value ? new Date(value) : null));
    const whole = from !== null && to !== null && from < to;
    this.#to.setCustomValidity(whole ? '' : 'The end is not after the beginning.');
    this.#to.setAttribute('aria-invalid', String(!whole));
    const span = whole ? `?from=${from.toISOString()}&to=${to.toISOString()}` : '';
    const ending = this.site.container ?? 'mp4';
    /** @type {[string, [string, string][]][]} */
    const lists = [
      ['download-tables', [['Tracks (CSV)', 'api/operator/tracks.csv'], ['Choices (CSV)', 'api/operator/choices.csv']]],
      ['download-cameras', this.site.cameras.map((it) => [it, `cameras/${it}/live.mp4`])],
      ['download-people', this.#people.map(({ object }) => [person(object), `objects/${object}/best.mp4`])],
    ];
    for (const [list, files] of lists) {
      const there = span && (ending === 'mp4' || list === 'download-tables');
      const links = there ? files.map((file) => make('li', {}, this.#file(file, span))) : [];
      element(list).replaceChildren(...links);
      if (!links.length) element(list).append(make('li', { className: 'quiet', textContent: there ? 'Nobody' : reason(whole) }));
    }
  }

  /**
   * @param {[string, string]} file words and address
   * @param {string} span
   */
  #file([words, address], span) {
    const stamp = this.#from.value.replace(/:/g, '');
    const name = address.includes('.csv') ? '' : `${this.site.name}-${words.replace(/[^\w-]+/g, '-')}-${stamp}.mp4`;
    return make('a', { href: address + span, download: name, textContent: words });
  }
}

/** @param {boolean} whole */
function reason(whole) {
  return whole ? 'VP8 is not recorded.' : 'The end is not after the beginning.';
}

/**
 * As the input writes it: local time without a zone.
 *
 * @param {Date} moment
 */
function local(moment) {
  const shifted = new Date(moment.getTime() - moment.getTimezoneOffset() * 60_000);
  return shifted.toISOString().slice(0, 19);
}
