/** What became of trials: a line for each, so that none hides another's. */

import { make, setText } from './dom.js';

const ENDED_MAX = 6;

/** @typedef {(text: string, hasEnded?: boolean) => void} ShowLine */

export class TrialLines {
  /** @type {{name: string, item: HTMLElement, hasEnded: boolean}[]} */
  #lines = [];

  /** @param {string} title of the list, for screen readers */
  constructor(title) {
    this.list = make('ul', { className: 'trials' });
    this.list.setAttribute('aria-label', title);
    this.list.setAttribute('aria-live', 'polite');
  }

  /** @returns {boolean} whether there are none */
  get empty() {
    return this.#lines.length === 0;
  }

  /**
   * Add the line of a trial, in the place of an earlier one of the same that has ended.
   *
   * @param {string} name of what is tried
   * @returns {ShowLine} sets the line's text
   */
  begin(name) {
    const line = { name, item: make('li', {}), hasEnded: false };
    this.#remove(this.#lines.filter((earlier) => earlier.hasEnded && earlier.name === name));
    this.#remove(this.#lines.filter(({ hasEnded }) => hasEnded).slice(0, -ENDED_MAX));
    this.#lines.push(line);
    this.list.append(line.item);
    return (text, hasEnded = false) => {
      line.hasEnded = hasEnded;
      setText(line.item, text);
    };
  }

  /** @param {{item: HTMLElement}[]} lines */
  #remove(lines) {
    this.#lines = this.#lines.filter((line) => !lines.includes(line));
    for (const { item } of lines) item.remove();
  }
}
