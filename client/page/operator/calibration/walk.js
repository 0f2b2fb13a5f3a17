/** The calibration walk: its coverage while a person walks, and the result of the calibration. */

import { requestOperator } from '../../shared/requests.js';
import { element, make, setText } from '../../shared/dom.js';
import { Repeater } from '../section.js';
import { ResultView, showList } from './result_view.js';

/** @import {Walk, WalkCamera} from '../api_types.js' */
/** @import {Section, ShowError} from '../section.js' */

const INTERVAL_MS = 1000;
/** @type {Record<Walk['state'], string>} */
const STATES = {
  none: 'No walk yet.',
  walking: 'Walk now.',
  working: 'Calculating.',
  done: '',
};

/** @implements {Section} */
export class CalibrationWalk {
  #repeater;
  /** @type {HTMLButtonElement} */
  #start = element('walk-start');
  /** @type {HTMLButtonElement} */
  #finish = element('walk-finish');
  /** @type {HTMLButtonElement} */
  #resume = element('walk-resume');
  /** @type {HTMLButtonElement} */
  #discard = element('walk-discard');
  /** @type {HTMLInputElement} */
  #person = element('walk-person');
  #state = element('walk-state');
  #result = new ResultView('walk', (text) => setText(this.#state, text));
  #shownResult = '';

  /**
   * @param {ShowError} showError
   * @param {() => Promise<void>} fileChanged called when the result was written into the configuration
   */
  constructor(showError, fileChanged) {
    this.showError = showError;
    this.fileChanged = fileChanged;
    this.#repeater = new Repeater(async () => this.#show(await requestOperator('walk')), INTERVAL_MS, showError);
    this.#start.addEventListener('click', () => void this.#request('POST', { action: 'start' }));
    this.#finish.addEventListener('click', () => {
      if (this.#person.reportValidity()) void this.#request('POST', { action: 'finish', person: this.#person.valueAsNumber });
    });
    this.#resume.addEventListener('click', () => void this.#request('POST', { action: 'resume' }));
    this.#discard.addEventListener('click', () => void this.#request('DELETE'));
    element('walk-apply').addEventListener('click', async () => {
      if (!(await this.#request('POST', { action: 'apply' }))) return;
      setText(this.#state, 'Written into the configuration; the earlier file is kept beside it.');
      await this.fileChanged();
    });
  }

  open() {
    this.#repeater.start();
  }

  close() {
    this.#repeater.stop();
  }

  /**
   * @param {'POST' | 'DELETE'} method
   * @param {object} [content]
   * @returns {Promise<boolean>} whether it was accepted
   */
  async #request(method, content) {
    try {
      this.#show(await requestOperator('walk', method, content));
      this.showError(null);
      return true;
    } catch (error) {
      this.showError(error);
      return false;
    }
  }

  /** @param {Walk} walk */
  #show(walk) {
    const { state } = walk;
    this.#start.disabled = state === 'walking' || state === 'working';
    this.#finish.disabled = state !== 'walking';
    this.#resume.disabled = state !== 'done' && state !== 'working';
    this.#discard.disabled = state === 'none';
    if (state !== 'done') setText(this.#state, describeState(walk));
    element('walk-covered').hidden = state === 'none';
    element('walk-cameras').replaceChildren(...walk.cameras.map(coverageRow));
    const pairs = walk.pairs.map(({ one, other, seconds }) => make('li', { textContent: `${one} and ${other}: ${seconds.toFixed(0)} s` }));
    element('walk-pairs').replaceChildren(...pairs);
    showList('walk-uncovered', state === 'walking' ? walk.uncovered : []);
    this.#showResult(walk);
  }

  /** @param {Walk} walk */
  #showResult(walk) {
    const result = walk.state === 'done' ? walk.error + walk.lines.join() : '';
    if (result === this.#shownResult) return;
    this.#shownResult = result;
    if (result) setText(this.#state, walk.error ? `Calibration failed: ${walk.error}` : describeResult(walk));
    const { lines, configuration } = walk;
    const plan = `api/operator/walk/plan.png?${Date.now()}`; // each plan has the same address
    this.#result.show(configuration ? { lines, plan, ground: 'api/operator/walk/ground.json', configuration } : null);
  }
}

/** @param {Walk} walk */
function describeState({ state, seconds, max_seconds: max }) {
  if (state === 'walking' && seconds >= max) return `The walk has reached its maximum of ${max / 60} minutes.`;
  const minutes = `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, '0')}`;
  return state === 'none' ? STATES.none : `${STATES[state]} ${minutes} minutes so far.`;
}

/** @param {Walk} walk */
function describeResult({ insufficient }) {
  return insufficient ? `The result is uncertain. The walk did not cover enough: ${insufficient}.` : 'Calibrated. The configuration in force is unchanged.';
}

/** @param {WalkCamera} camera */
function coverageRow({ camera, foot_points: footPoints, thirds, depth_ratio: depthRatio }) {
  const shares = thirds.map((share) => make('td', { textContent: footPoints ? `${Math.round(100 * share)} %` : '–' }));
  return make('tr', {}, make('th', { scope: 'row', textContent: camera }), ...shares, make('td', { textContent: depthRatio === null ? '–' : `${depthRatio.toFixed(1)} times` }));
}
