/** The search of the past: who stayed where in a time span; a stay that is pressed is played. */

import { duration, joinStays, searchAddress, when } from './stays.js';
import { element, make, setText } from '../shared/dom.js';
import { getJson, relative, requestJson } from '../shared/requests.js';
import { longLabel } from '../people/names.js';
import { StayPictures } from './stay_pictures.js';

/** @import {Person, Rules} from '../shared/api_types.js' */
/** @import {PastQuestion, PastStay} from './stays.js' */
/** @import {Viewer} from '../viewer.js' */

const TIMEOUT_MS = 60_000; // the server works for some seconds, after the searches of others
const REQUESTS_MAX = 50; // of one search: the server answers a long span in parts
const PICTURE_WIDTH = 128;

export class PastSearch {
  /** @type {HTMLDetailsElement} */
  #details = element('search');
  /** @type {HTMLFormElement} */
  #form = element('search-form');
  /** @type {HTMLSelectElement} */
  #span = element('search-span');
  /** @type {HTMLInputElement} */
  #from = element('search-from');
  /** @type {HTMLInputElement} */
  #to = element('search-to');
  /** @type {HTMLSelectElement} */
  #place = element('search-place');
  /** @type {HTMLSelectElement} */
  #who = element('search-who');
  /** @type {HTMLSelectElement} */
  #order = element('search-order');
  #pictures;
  #count = 0; // of searches: only the newest shows what it finds

  /** @param {Viewer} viewer */
  constructor(viewer) {
    this.viewer = viewer;
    this.#pictures = new StayPictures(() => viewer.format);
    this.#details.addEventListener('toggle', () => {
      if (this.#details.open) void this.#opened();
    });
    this.#span.addEventListener('change', () => this.#showSpan());
    this.#form.addEventListener('submit', (event) => {
      event.preventDefault();
      void this.#search();
    });
  }

  /** VP8 is not recorded, and nothing of the past is encoded anew. */
  update() {
    const { format, site } = this.viewer;
    this.#details.hidden = format.container === 'webm' || format.transcoded || Boolean(site?.blur);
  }

  async #opened() {
    const now = new Date();
    if (!this.#to.value) {
      this.#to.value = local(now);
      this.#from.value = local(new Date(now.getTime() - 3_600_000));
    }
    offer(this.#who, [['', 'Everybody'], ...(this.viewer.people ?? []).map(whoOption)]);
    /** @type {Rules | null} */
    const rules = await getJson('api/rules').catch(() => null); // not with a token for one person or camera
    const areas = (rules?.zones ?? []).filter(({ area }) => area !== null).map(({ zone }) => zone);
    offer(this.#place, [
      ['anywhere', 'Anywhere'],
      ...(areas.length ? [pair('zones', 'Every zone'), pair('places', 'Every zone and camera')] : []),
      ['cameras', 'Every camera'],
      ...areas.map((zone) => pair(`zone:${zone}`, `Zone ${zone}`)),
      ...(this.viewer.site?.cameras ?? []).map((camera) => pair(`camera:${camera}`, `Camera ${camera}`)),
    ]);
  }

  #showSpan() {
    element('search-between').hidden = this.#span.value !== 'between';
  }

  /** @returns {PastQuestion} */
  #question() {
    const object = this.#who.value === '' ? null : Number(this.#who.value);
    const [from, to] = spanOf(this.#span.value, this.#from.value, this.#to.value, new Date());
    return { from, to, place: this.#place.value, object };
  }

  /** Search part by part, and list what is found after each. */
  async #search() {
    const search = (this.#count += 1);
    const { fps } = this.viewer.site ?? { fps: 1 };
    const order = this.#order.value;
    /** @type {PastStay[]} */
    let stays = [];
    let found = 0;
    this.#report('Searching…');
    this.#list([]);
    try {
      const question = this.#question();
      for (let request = 0; request < REQUESTS_MAX; request += 1) {
        const answer = await requestJson(searchAddress(question, order), 'GET', undefined, TIMEOUT_MS);
        if (search !== this.#count) return;
        found += answer.found;
        stays = joinStays([...stays, ...answer.stays], order, fps);
        this.#list(stays);
        if (answer.next === null) return this.#report(summary(stays, found, question.place));
        question.from = `p${answer.next}`;
        this.#report(`Searched until ${new Date(answer.ends).toLocaleString()}…`);
      }
      this.#report(`Searched only a part: ${summary(stays, found, question.place)}`);
    } catch (error) {
      if (search === this.#count) this.#report(error instanceof Error ? error.message : String(error));
    }
  }

  /** @param {string} text */
  #report(text) {
    setText(element('search-status'), text);
  }

  /** @param {PastStay[]} stays */
  #list(stays) {
    this.#pictures.clear();
    element('search-stays').replaceChildren(...stays.map((stay) => make('li', {}, this.#item(stay))));
  }

  /** @param {PastStay} stay */
  #item(stay) {
    const place = stay.zone ?? stay.camera ?? `seen by ${stay.cameras.join(', ')}`;
    const canvas = make('canvas', { width: PICTURE_WIDTH, height: 0, ariaHidden: 'true' });
    const text = make('span', {}, make('strong', { textContent: label(stay) }), place, make('br'), when(stay, new Date()));
    if (stay.run !== null) return make('a', { href: relative(stay.clip ?? ''), target: '_blank' }, canvas, text);
    const button = make('button', { type: 'button', title: 'Play' }, canvas, text);
    button.addEventListener('click', () => this.viewer.selectAt(stay.object, stay.first));
    // From its middle: at first people are at the edge of a picture.
    const gop = this.viewer.site?.gop ?? 1;
    const middle = Math.floor((stay.first + stay.frames / 2) / gop) * gop;
    this.#pictures.add({ canvas, object: stay.object, first: middle, end: middle + gop });
    return button;
  }
}

/**
 * @param {string} span seconds back, a day, or between
 * @param {string} from local time
 * @param {string} to local time
 * @param {Date} now
 * @returns {[string, string | null]} from and to of the search
 * @throws {Error} the end is not after the start
 */
export function spanOf(span, from, to, now) {
  const midnight = new Date(now.getFullYear(), now.getMonth(), now.getDate());
  const dayBefore = new Date(now.getFullYear(), now.getMonth(), now.getDate() - 1);
  if (span === 'today') return [midnight.toISOString(), null];
  if (span === 'yesterday') return [dayBefore.toISOString(), midnight.toISOString()];
  if (span !== 'between') return [`-${span}`, null];
  const [start, end] = [new Date(from), new Date(to)];
  if (!(start < end)) throw new Error('The end is not after the start.');
  return [start.toISOString(), end.toISOString()];
}

/**
 * @param {PastStay[]} stays
 * @param {number} found
 * @param {string} place
 */
function summary(stays, found, place) {
  if (!stays.length) return 'No one was seen there.';
  const people = new Set(stays.map(({ run, object }) => `${run} ${object}`)).size;
  const total = duration(stays.reduce((sum, { seconds }) => sum + seconds, 0));
  const all = ['zones', 'cameras', 'places'].includes(place) ? '' : `, ${total} in all`; // those overlap
  const listed = stays.length < found && stays.length >= 200 ? `${stays.length} of ${found}` : String(stays.length);
  const zones = /zone|places/.test(place) ? ' Zones are where they are today.' : '';
  return `${listed} ${stays.length === 1 ? 'stay' : 'stays'} of ${people} ${people === 1 ? 'person' : 'people'}${all}.${zones}`;
}

/** @param {PastStay} stay */
function label({ object, run, name }) {
  if (run !== null) return `Person ${object} of an earlier run`;
  return name ? `Person ${object}, ${name}` : longLabel(object);
}

/**
 * @param {Person} person
 * @returns {[string, string]}
 */
function whoOption({ object }) {
  return [String(object), longLabel(object)];
}

/**
 * @param {string} value
 * @param {string} text
 * @returns {[string, string]}
 */
function pair(value, text) {
  return [value, text];
}

/**
 * Offer options, and keep the selected one.
 *
 * @param {HTMLSelectElement} select
 * @param {[string, string][]} options value and text
 */
function offer(select, options) {
  const { value } = select;
  select.replaceChildren(...options.map(([value, text]) => new Option(text, value)));
  if (options.some(([offered]) => offered === value)) select.value = value;
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
