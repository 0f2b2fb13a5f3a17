/** What views are chosen by, to try out: it holds at once, and the lines for the configuration stand below. */

import { ask } from './requests.js';
import { element, make, put } from './section.js';
import { copy } from '../shared/tools.js';

/** @import {SelectionSettings, Values} from './contract.js' */
/** @import {Section, Tell} from './section.js' */

/** @type {[string, string, string][]} key, name, what it does */
const FIELDS = [
  ['lookahead', 'Look-ahead, frames', 'How many frames are seen before a view is chosen; all of it is delay.'],
  ['switch_cost_s', 'Cut cost λ, s', 'How many seconds of not seeing the person are worth a cut.'],
  ['extrapolate_s', 'Extrapolation, s', 'For how long after the look-ahead its last views are assumed to stay.'],
  ['presence_decay_s', 'Presence decay, s', 'How long a view takes to decay to nothing after the last detection.'],
  ['undetected_weight', 'Undetected weight', 'Weight of a view in which only other cameras detect the person, 0 to 1.'],
  ['min_shot_s', 'Shortest shot, s', 'The least time that a camera is shown.'],
  ['quality.size', 'Size', 'How large the person is in the picture.'],
  ['quality.truncation', 'Truncation', "How much of the person is inside the picture."],
  ['quality.occlusion', 'Occlusion', 'How much of the person is not occluded by others.'],
  ['quality.centering', 'Centering', 'How near the middle of the picture.'],
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
  /** @type {Values} in force, as far as known */
  #values = {};

  /** @param {Tell} tell */
  constructor(tell) {
    this.tell = tell;
    element('selection-form').addEventListener('submit', (event) => {
      event.preventDefault();
      void this.#change('PUT', this.#entered());
    });
    element('selection-back').addEventListener('click', () => void this.#change('DELETE'));
    element('selection-copy').addEventListener('click', async () => {
      const done = await copy(this.#lines.value);
      put(this.#state, done ? 'The lines are copied.' : 'Select the lines and copy them.');
      if (!done) this.#lines.select();
    });
  }

  open() {
    void ask('view_selection').then((settings) => this.#show(settings), this.tell);
  }

  close() {}

  /**
   * @param {'PUT' | 'DELETE'} method
   * @param {Values} [values]
   */
  async #change(method, values) {
    try {
      this.#show(await ask('view_selection', method, values));
      this.tell(null);
    } catch (error) {
      this.tell(error);
    }
  }

  /** @returns {Values} those that were changed */
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
  #show({ values, file, lines, min_lookahead: least, max_lookahead: most }) {
    this.#values = values;
    if (!this.#fields.size) element('selection-fields').append(...FIELDS.filter(([key]) => key in values).map((it) => this.#field(it)));
    const ahead = this.#fields.get('lookahead')?.input;
    if (ahead) Object.assign(ahead, { min: String(least), max: String(most), step: '1' });
    let tried = 0;
    for (const [key, { input, file: said }] of this.#fields) {
      const value = values[key];
      if (typeof value === 'boolean') input.checked = value;
      else input.value = String(value);
      const differs = value !== file[key];
      tried += Number(differs);
      put(said, differs ? `file: ${file[key]}` : '');
    }
    put(this.#state, tried ? `${tried} changed from the file.` : 'As in the file.');
    this.#lines.value = lines || '# all at their defaults\n';
  }

  /** @param {[string, string, string]} field */
  #field([key, name, does]) {
    const weight = key.startsWith('quality.');
    const input = make('input', key === 'quality.relative' ? { type: 'checkbox' } : { type: 'number', min: '0', step: 'any', required: true });
    if (weight) input.max = '1';
    input.id = `selection-${key}`;
    const help = make('small', { id: `${input.id}-help`, textContent: does });
    input.setAttribute('aria-describedby', help.id);
    const file = make('span', { className: 'file' });
    this.#fields.set(key, { input, file });
    return make('p', {}, make('label', { htmlFor: input.id, textContent: name }), input, file, help);
  }
}
