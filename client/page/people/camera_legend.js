/** The site's cameras: their colors, which one is displayed, held or preferred, and their states. */

import { formatCameraProblem } from '../shared/camera_problem.js';
import { make } from '../shared/dom.js';

/** @import {Camera} from '../shared/api_types.js' */
/** @import {ViewPreference} from './view_preference.js' */
/** @import {Palette} from './palette.js' */

const SHORTCUTS = 9; // cameras with a digit key

export class CameraLegend {
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
    this.#items = new Map(cameras.map((camera, at) => [camera, this.#item(camera, at, palette.color(camera))]));
    this.list.replaceChildren(...this.#items.values());
  }

  /** @param {Camera[]} cameras */
  show(cameras) {
    for (const each of cameras) {
      const { camera, state, message } = each;
      const item = this.#items.get(camera);
      if (!item) continue;
      item.classList.toggle('away', state !== 'live');
      item.title = formatCameraProblem(each);
      const [summary] = message.split(':'); // the title has the details
      /** @type {HTMLElement} */ (item.lastElementChild).textContent = state === 'live' ? summary : state;
    }
  }

  /**
   * @param {string | null} displayed
   * @param {ViewPreference} preference
   */
  mark(displayed, { camera: selected, prefers }) {
    for (const [camera, item] of this.#items) {
      if (camera === displayed) item.setAttribute('aria-current', 'true');
      else item.removeAttribute('aria-current');
      item.firstElementChild?.setAttribute('aria-pressed', String(camera === selected));
      item.classList.toggle('preferred', camera === selected && prefers);
    }
  }

  /**
   * @param {string} camera
   * @param {number} at
   * @param {string} color
   */
  #item(camera, at, color) {
    const button = make('button', { type: 'button', className: 'chip', textContent: camera, title: `Hold ${camera}` });
    if (at < SHORTCUTS) {
      button.title += ` (${at + 1})`;
      button.setAttribute('aria-keyshortcuts', String(at + 1));
    }
    button.addEventListener('click', () => this.hold(camera));
    const item = make('li', {}, button, make('small'));
    item.style.setProperty('--camera', color);
    return item;
  }
}
