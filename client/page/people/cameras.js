/** The site's cameras: the key to the strip's colours, which one is live or held, and which are not well. */

/** @import {Camera} from '../shared/contract.js' */
/** @import {Override} from './view_preference.js' */
/** @import {Palette} from './palette.js' */

/** @type {Record<Camera['state'], string>} */
const WORDS = { live: '', gone: 'gone', ended: 'ended', starting: 'starting', refused: 'refused' };

const KEYS = 9; // cameras that have a key

export class Cameras {
  /** @type {Map<string, HTMLElement>} */
  #items = new Map();

  /**
   * @param {HTMLElement} list
   * @param {(camera: string) => void} hold
   */
  constructor(list, hold) {
    this.list = list;
    this.hold = hold;
  }

  /**
   * @param {string[]} cameras
   * @param {Palette} palette
   */
  configure(cameras, palette) {
    if (cameras.join() === [...this.#items.keys()].join()) return;
    const make = (/** @type {string} */ camera, /** @type {number} */ at) => this.#make(camera, at, palette.colour(camera));
    this.#items = new Map(cameras.map((camera, at) => [camera, make(camera, at)]));
    this.list.replaceChildren(...this.#items.values());
  }

  /** @param {Camera[]} states */
  show(states) {
    for (const { camera, state, message } of states) {
      const item = this.#items.get(camera);
      if (!item) continue;
      item.classList.toggle('away', state !== 'live');
      item.title = message;
      const [said] = message.split(':'); // why stands in the title
      /** @type {HTMLElement} */ (item.lastElementChild).textContent = WORDS[state] || (state === 'live' ? said : state);
    }
  }

  /**
   * @param {string | null} live
   * @param {Override} override
   */
  mark(live, { camera: wished, prefers }) {
    for (const [camera, item] of this.#items) {
      if (camera === live) item.setAttribute('aria-current', 'true');
      else item.removeAttribute('aria-current');
      item.firstElementChild?.setAttribute('aria-pressed', String(camera === wished));
      item.classList.toggle('preferred', camera === wished && prefers);
    }
  }

  /**
   * @param {string} camera
   * @param {number} at
   * @param {string} colour
   */
  #make(camera, at, colour) {
    const item = document.createElement('li');
    item.style.setProperty('--camera', colour);
    const name = document.createElement('button');
    name.type = 'button';
    name.className = 'chip';
    name.textContent = camera;
    name.title = `Hold ${camera}`;
    if (at < KEYS) {
      name.title += ` (${at + 1})`;
      name.setAttribute('aria-keyshortcuts', String(at + 1));
    }
    name.addEventListener('click', () => this.hold(camera));
    item.append(name, document.createElement('small'));
    return item;
  }
}
