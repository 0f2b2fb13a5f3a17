/** The result of a calibration: its report, floor plan, ground file and configuration lines. */

import { element, make } from '../../shared/dom.js';
import { copy } from '../../shared/tools.js';

/**
 * @typedef {object} ShownResult
 * @property {string[]} lines the report
 * @property {string} plan address of the floor plan; empty: there is none
 * @property {string} ground address of the ground file
 * @property {string} configuration YAML
 */

export class ResultView {
  /** @type {HTMLImageElement} */
  #plan;
  /** @type {HTMLAnchorElement} */
  #ground;
  /** @type {HTMLTextAreaElement} */
  #lines;

  /**
   * @param {string} prefix of the ids of its elements
   * @param {(text: string) => void} say
   */
  constructor(prefix, say) {
    this.prefix = prefix;
    this.#plan = element(`${prefix}-plan`);
    this.#ground = element(`${prefix}-ground`);
    this.#lines = element(`${prefix}-configuration`);
    element(`${prefix}-copy`).addEventListener('click', async () => {
      const copied = await copy(this.#lines.value);
      say(copied ? 'Copied.' : 'Select the lines and copy them.');
      if (!copied) this.#lines.select();
    });
  }

  /** @param {ShownResult | null} result null: there is none */
  show(result) {
    element(`${this.prefix}-result`).hidden = !result;
    showList(`${this.prefix}-lines`, result?.lines ?? []);
    this.#lines.value = result?.configuration ?? '';
    if (result) this.#ground.href = result.ground;
    if (result?.plan) this.#plan.src = result.plan;
    else this.#plan.removeAttribute('src');
  }
}

/**
 * Update a list if it differs, so that selected text stays selected.
 *
 * @param {string} id
 * @param {string[]} lines
 */
export function showList(id, lines) {
  const list = element(id);
  if ([...list.children].map((item) => item.textContent).join('\n') === lines.join('\n')) return;
  list.replaceChildren(...lines.map((textContent) => make('li', { textContent })));
}
