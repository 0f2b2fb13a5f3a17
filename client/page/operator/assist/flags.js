/** What the operator was asked to look at: what is open, and what has become of the rest. */

import { when, words } from './flag_priority.js';
import { getJson } from '../../shared/requests.js';
import { label } from '../../people/names.js';
import { element, make, put } from '../section.js';

/** @import {Flag, Site} from '../../shared/contract.js' */
/** @import {Section, Tell} from '../section.js' */

const SHOWN = 20;
const BECAME = {
  raised: 'waits to be answered',
  followed: 'is followed',
  answered: 'was answered',
  expired: 'was not answered',
};

/** @implements {Section} */
export class FlagList {
  /** @type {Map<number, Flag>} */
  #flags = new Map();
  #list = element('flag-list');
  #none = element('flag-none');

  /**
   * @param {Site} site
   * @param {Tell} tell
   */
  constructor(site, tell) {
    this.site = site;
    this.tell = tell;
  }

  close() {}

  open() {
    void getJson('api/flags').then(({ flags }) => {
      this.#flags.clear();
      for (const flag of flags.reverse()) this.#flags.set(flag.id, flag);
      this.#show();
    }, this.tell);
  }

  /** @param {Flag} flag */
  take(flag) {
    this.#flags.set(flag.id, flag);
    this.#show();
  }

  #show() {
    const all = [...this.#flags.values()].sort((one, other) => other.id - one.id);
    for (const { id } of all.slice(SHOWN)) this.#flags.delete(id);
    const lines = all.slice(0, SHOWN).map((flag) => this.#line(flag));
    put(this.#none, lines.length ? '' : 'None so far.');
    if (lines.join('\n') === this.#list.dataset.lines) return;
    this.#list.dataset.lines = lines.join('\n');
    this.#list.replaceChildren(...lines.map((line) => make('li', {}, line)));
  }

  /** @param {Flag} flag */
  #line(flag) {
    const { cameras, raised, state } = flag;
    return `${words(flag, label)} ${when(flag, raised, this.site.fps)} (${cameras.join(', ')}): ${BECAME[state]}`;
  }
}
