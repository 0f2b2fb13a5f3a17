/** The site's cameras: the key to the strip's colours, which one is live, and which are not well. */

/** @import {Camera} from './contract.js' */
/** @import {Palette} from './palette.js' */

/** @type {Record<Camera['state'], string>} */
const WORDS = { live: '', gone: 'gone', ended: 'ended', starting: 'starting', refused: 'refused' };

export class Cameras {
  /** @type {Map<string, HTMLElement>} */
  #items = new Map();

  /** @param {HTMLElement} list */
  constructor(list) {
    this.list = list;
  }

  /**
   * @param {string[]} cameras
   * @param {Palette} palette
   */
  configure(cameras, palette) {
    if (cameras.join() === [...this.#items.keys()].join()) return;
    this.#items = new Map(cameras.map((camera) => [camera, makeItem(camera, palette.colour(camera))]));
    this.list.replaceChildren(...this.#items.values());
  }

  /** @param {Camera[]} states */
  show(states) {
    for (const { camera, state, message } of states) {
      const item = this.#items.get(camera);
      if (!item) continue;
      item.classList.toggle('away', state !== 'live');
      item.title = message;
      /** @type {HTMLElement} */ (item.lastElementChild).textContent = WORDS[state] ?? state;
    }
  }

  /** @param {string | null} live */
  mark(live) {
    for (const [camera, item] of this.#items) {
      if (camera === live) item.setAttribute('aria-current', 'true');
      else item.removeAttribute('aria-current');
    }
  }
}

/**
 * @param {string} camera
 * @param {string} colour
 */
function makeItem(camera, colour) {
  const item = document.createElement('li');
  item.style.setProperty('--camera', colour);
  const name = document.createElement('span');
  name.className = 'chip';
  name.textContent = camera;
  item.append(name, document.createElement('small'));
  return item;
}
