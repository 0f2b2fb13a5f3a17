/** What every section of the operator's page is made of. */

export { element } from '../shared/element.js';

const SVG = 'http://www.w3.org/2000/svg';

/** @typedef {(error: unknown) => void} Tell what went wrong; null: nothing does any more */

/**
 * @typedef {object} Section of the page
 * @property {() => void} open it is shown from now on
 * @property {() => void} close it is not
 */

/**
 * @template {keyof HTMLElementTagNameMap} Name
 * @param {Name} name
 * @param {Partial<HTMLElementTagNameMap[Name]>} [properties]
 * @param {...(Node | string)} children
 * @returns {HTMLElementTagNameMap[Name]}
 */
export function make(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

/**
 * @param {string} name
 * @param {Record<string, string | number>} [attributes]
 */
export function svg(name, attributes = {}) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  return made;
}

/**
 * Only where it differs: else what is read out would be read again.
 *
 * @param {Element} shown
 * @param {string} text
 */
export function put(shown, text) {
  if (shown.textContent !== text) shown.textContent = text;
}

/** Does something again and again, one time after the other, while it is wanted and somebody looks. */
export class Repeated {
  #running = 0;

  /**
   * @param {() => Promise<void>} action
   * @param {number} everyMs
   * @param {Tell} tell
   */
  constructor(action, everyMs, tell) {
    this.action = action;
    this.everyMs = everyMs;
    this.tell = tell;
  }

  start() {
    void this.#run((this.#running += 1));
  }

  stop() {
    this.#running += 1;
  }

  /** @param {number} run which goes on until another is begun, or it is stopped */
  async #run(run) {
    let failed = false;
    while (run === this.#running) {
      try {
        if (!document.hidden) await this.action();
        if (failed && run === this.#running) this.tell(null);
        failed = false;
      } catch (error) {
        failed = true;
        if (run === this.#running) this.tell(error);
      }
      await new Promise((resolve) => setTimeout(resolve, this.everyMs));
    }
  }
}
