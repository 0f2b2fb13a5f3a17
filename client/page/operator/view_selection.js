/** The settings of view selection: changes apply at once, and their YAML for the configuration is shown. */

import { requestOperator } from '../shared/requests.js';
import { element, make, setText } from '../shared/dom.js';
import { copy } from '../shared/tools.js';

/** @import {SelectionSettings, Values} from './api_types.js' */
/** @import {Section, ShowError} from './section.js' */

/** @type {[string, string, string][]} key, label, explanation */
const FIELDS = [
  ['lookahead_s', 'Look-ahead, s', 'Seconds known ahead when a view is selected; adds that delay.'],
  ['switch_cost_s', 'Cut cost λ, s', 'Seconds of not seeing the person that cost as much as a cut.'],
  ['extrapolate_s', 'Extrapolation, s', 'For how long after the look-ahead its last views are assumed to stay.'],
  ['presence_decay_s', 'Presence decay, s', 'How long a view takes to decay to nothing after the last detection.'],
  ['undetected_weight', 'Undetected weight', 'Weight of a view in which only other cameras detect the person, 0 to 1.'],
  ['min_shot_s', 'Shortest shot, s', 'The least time that a camera is shown.'],
  ['quality.size', 'Size', 'How large the person is in the picture.'],
  ['quality.truncation', 'Truncation', "How much of the person is inside the picture."],
  ['quality.occlusion', 'Occlusion', 'How much of the person is not occluded by others.'],
  ['quality.centering', 'Centering', 'How near the middle of the picture.'],
  ['quality.clarity', 'Clear picture', 'Whether the picture is clear: not covered, turned away, blurred, dark or frozen.'],
  ['quality.sharpness', 'Sharpness', 'How much detail there is; cameras measure it only if the file has a weight for it.'],
  ['quality.facing', 'Facing', 'Walking towards the camera, not away from it; needs the ground.'],
  ['quality.confidence', 'Confidence', 'Confidence of the track.'],
  ['quality.relative', 'Relative', 'Quality relative to the best view of the moment.'],
];

/** @implements {Section} */
export class ViewSelectionForm {
  /** @type {Map<string, {input: HTMLInputElement, file: HTMLElement}>} */
  #fields = new Map();
  #state = element('selection-state');
  /** @type {HTMLTextAreaElement} */
  #lines = element('selection-lines');
  /** @type {Values} in force */
  #values = {};

  /** @param {ShowError} showError */
  constructor(showError) {
    this.showError = showError;
    element('selection-form').addEventListener('submit', (event) => {
      event.preventDefault();
      void this.#change('PUT', this.#entered());
    });
    element('selection-revert').addEventListener('click', () => void this.#change('DELETE'));
    element('selection-copy').addEventListener('click', async () => {
      const copied = await copy(this.#lines.value);
      setText(this.#state, copied ? 'Copied.' : 'Select the lines and copy them.');
      if (!copied) this.#lines.select();
    });
  }

  open() {
    void requestOperator('view_selection').then((settings) => this.#show(settings), this.showError);
  }

  close() {}

  /**
   * @param {'PUT' | 'DELETE'} method
   * @param {Values} [values]
   */
  async #change(method, values) {
    try {
      this.#show(await requestOperator('view_selection', method, values));
      this.showError(null);
    } catch (error) {
      this.showError(error);
    }
  }

  /** @returns {Values} the changed ones */
  #entered() {
    /** @type {Values} */
    const values = {};
    for (const [key, { input }] of this.#fields) {
      const value = input.type === 'checkbox' ? input.checked : input.valueAsNumber;
      if (value !== this.#values[key]) values[key] = value;
    }
    return values;
  }

  /** @param {SelectionSettings} settings */
  #show({ values, file, lines, min_lookahead_s: min, max_lookahead_s: max }) {
    this.#values = values;
    if (!this.#fields.size) element('selection-fields').append(...FIELDS.filter(([key]) => key in values).map((field) => this.#createField(field)));
    const lookahead = this.#fields.get('lookahead_s')?.input;
    if (lookahead) Object.assign(lookahead, { min: String(min), max: String(max) });
    let changed = 0;
    for (const [key, { input, file: fileValue }] of this.#fields) {
      const value = values[key];
      if (typeof value === 'boolean') input.checked = value;
      else input.value = String(value);
      const differs = value !== file[key];
      changed += Number(differs);
      setText(fileValue, differs ? `file: ${file[key]}` : '');
    }
    setText(this.#state, changed ? `${changed} changed from the file.` : 'As in the file.');
    this.#lines.value = lines || '# all at their defaults\n';
  }

  /** @param {[string, string, string]} field */
  #createField([key, label, explanation]) {
    const weight = key.startsWith('quality.');
    const input = make('input', key === 'quality.relative' ? { type: 'checkbox' } : { type: 'number', min: '0', step: 'any', required: true });
    if (weight) input.max = '1';
    input.id = `selection-${key}`;
    const help = make('small', { id: `${input.id}-help`, textContent: explanation });
    input.setAttribute('aria-describedby', help.id);
    const file = make('span', { className: 'file' });
    this.#fields.set(key, { input, file });
    return make('p', {}, make('label', { htmlFor: input.id, textContent: label }), input, file, help);
  }
}
