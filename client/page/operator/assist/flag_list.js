/** The newest flags and their states. */

import { describeFlag, describeTime } from './flag_priority.js';
import { element, make, setText } from '../../shared/dom.js';
import { getJson } from '../../shared/requests.js';
import { shortLabel } from '../../people/names.js';

/** @import {Flag, Site} from '../../shared/api_types.js' */
/** @import {Section, ShowError} from '../section.js' */

const MAX_FLAGS = 20;
const STATES = { raised: 'open', followed: 'being followed', answered: 'answered', expired: 'expired without an answer' };

/** @implements {Section} */
export class FlagList {
  /** @type {Map<number, Flag>} */
  #flags = new Map();
  /** Flags of events since the last request: newer than its answer.
   * @type {Map<number, Flag>} */
  #updated = new Map();
  #list = element('flag-list');
  #none = element('no-flags');

  /**
   * @param {Site} site
   * @param {ShowError} showError
   */
  constructor(site, showError) {
    this.site = site;
    this.showError = showError;
  }

  close() {}

  open() {
    /** @type {Map<number, Flag>} */
    const updated = new Map();
    this.#updated = updated;
    void getJson('api/flags').then(({ flags }) => {
      if (updated !== this.#updated) return; // there is a later request
      this.#flags = new Map([...flags.reverse(), ...updated.values()].map((flag) => [flag.id, flag]));
      this.#show();
    }, this.showError);
  }

  /** @param {Flag} flag */
  update(flag) {
    this.#updated.set(flag.id, flag);
    this.#flags.set(flag.id, flag);
    this.#show();
  }

  #show() {
    const newestFirst = [...this.#flags.values()].sort((a, b) => b.id - a.id);
    for (const { id } of newestFirst.slice(MAX_FLAGS)) this.#flags.delete(id);
    const lines = newestFirst.slice(0, MAX_FLAGS).map((flag) => this.#line(flag));
    setText(this.#none, lines.length ? '' : 'None so far.');
    if (lines.join('\n') === this.#list.dataset.lines) return;
    this.#list.dataset.lines = lines.join('\n');
    this.#list.replaceChildren(...lines.map((line) => make('li', {}, line)));
  }

  /** @param {Flag} flag */
  #line(flag) {
    const { cameras, raised, state } = flag;
    const time = describeTime(flag, raised, this.site.fps);
    return `${describeFlag(flag, shortLabel)} ${time} (${cameras.join(', ')}): ${STATES[state]}`;
  }
}
