/** The calibration walk: what it has covered while somebody walks, and what has come of it. */

import { ask } from './requests.js';
import { element, make, put, Repeated } from './section.js';
import { copy } from '../shared/tools.js';

/** @import {Walk, WalkCamera} from './contract.js' */
/** @import {Section, Tell} from './section.js' */

const EVERY_MS = 1000;
/** @type {Record<Walk['state'], string>} */
const WORDS = {
  none: 'No walk yet.',
  walking: 'Walk now.',
  working: 'Calculating.',
  done: '',
};

/** @implements {Section} */
export class CalibrationWalk {
  #repeated;
  /** @type {HTMLButtonElement} */
  #start = element('walk-start');
  /** @type {HTMLButtonElement} */
  #finish = element('walk-finish');
  /** @type {HTMLButtonElement} */
  #on = element('walk-on');
  /** @type {HTMLButtonElement} */
  #forget = element('walk-forget');
  /** @type {HTMLInputElement} */
  #person = element('walk-person');
  /** @type {HTMLImageElement} */
  #plan = element('walk-plan');
  /** @type {HTMLTextAreaElement} */
  #lines = element('walk-configuration');
  #state = element('walk-state');
  #shown = ''; // of what has come of it

  /** @param {Tell} tell */
  constructor(tell) {
    this.tell = tell;
    this.#repeated = new Repeated(async () => this.#show(await ask('walk')), EVERY_MS, tell);
    this.#start.addEventListener('click', () => void this.#do('POST', { action: 'start' }));
    this.#finish.addEventListener('click', () => {
      if (this.#person.reportValidity()) void this.#do('POST', { action: 'finish', person: this.#person.valueAsNumber });
    });
    this.#on.addEventListener('click', () => void this.#do('POST', { action: 'resume' }));
    this.#forget.addEventListener('click', () => void this.#do('DELETE'));
    element('walk-copy').addEventListener('click', async () => {
      const done = await copy(this.#lines.value);
      put(this.#state, done ? 'The lines are copied.' : 'Select the lines and copy them.');
      if (!done) this.#lines.select();
    });
  }

  open() {
    this.#repeated.start();
  }

  close() {
    this.#repeated.stop();
  }

  /**
   * @param {'POST' | 'DELETE'} method
   * @param {object} [content]
   */
  async #do(method, content) {
    try {
      this.#show(await ask('walk', method, content));
      this.tell(null);
    } catch (error) {
      this.tell(error);
    }
  }

  /** @param {Walk} walk */
  #show(walk) {
    const { state } = walk;
    this.#start.disabled = state === 'walking' || state === 'working';
    this.#finish.disabled = state !== 'walking';
    this.#on.disabled = state !== 'done' && state !== 'working';
    this.#forget.disabled = state === 'none';
    if (state !== 'done') put(this.#state, said(walk));
    element('walk-covered').hidden = state === 'none';
    element('walk-cameras').replaceChildren(...walk.cameras.map(row));
    const pairs = walk.pairs.map(({ one, other, seconds }) => make('li', { textContent: `${one} and ${other}: ${seconds.toFixed(0)} s` }));
    element('walk-pairs').replaceChildren(...pairs);
    list('walk-uncovered', state === 'walking' ? walk.uncovered : []);
    this.#showResult(walk);
  }

  /** @param {Walk} walk */
  #showResult(walk) {
    const come = walk.state === 'done' ? walk.error + walk.lines.join() : '';
    if (come === this.#shown) return;
    this.#shown = come;
    if (come) put(this.#state, walk.error ? `Calibration failed: ${walk.error}` : found(walk));
    const there = walk.configuration !== '';
    element('walk-result').hidden = !there;
    list('walk-lines', walk.lines);
    this.#lines.value = walk.configuration;
    if (there) this.#plan.src = `api/operator/walk/plan.png?${Date.now()}`; // another plan is at the same address
    else this.#plan.removeAttribute('src');
  }
}

/** @param {Walk} walk */
function said({ state, seconds, max_seconds: most }) {
  if (state === 'walking' && seconds >= most) return `That is enough: a walk has at most ${most / 60} minutes.`;
  const minutes = `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, '0')}`;
  return state === 'none' ? WORDS.none : `${WORDS[state]} ${minutes} minutes so far.`;
}

/** @param {Walk} walk */
function found({ insufficient }) {
  return insufficient ? `The result is a guess, the walk covered too little: ${insufficient}.` : 'Calibrated. The configuration in force is unchanged.';
}

/** @param {WalkCamera} camera */
function row({ camera, foot_points: feet, thirds, depth_ratio: depth }) {
  const shares = thirds.map((share) => make('td', { textContent: feet ? `${Math.round(100 * share)} %` : '–' }));
  return make('tr', {}, make('th', { scope: 'row', textContent: camera }), ...shares, make('td', { textContent: depth === null ? '–' : `${depth.toFixed(1)} times` }));
}

/**
 * Only where it differs: else what is selected would be lost.
 *
 * @param {string} id
 * @param {string[]} lines
 */
function list(id, lines) {
  const shown = element(id);
  if ([...shown.children].map((it) => it.textContent).join('\n') === lines.join('\n')) return;
  shown.replaceChildren(...lines.map((textContent) => make('li', { textContent })));
}
