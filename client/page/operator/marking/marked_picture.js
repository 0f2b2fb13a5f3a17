/** A picture of a chosen camera on which points are marked, in pixels of the camera's own picture. */

import { toCameraPixels, toSitePixels } from './camera_pixels.js';
import { requestOperator } from '../../shared/requests.js';
import { element, make, setText } from '../../shared/dom.js';
import { MarkingStage } from './marking_stage.js';
import { loadStill } from '../camera_stills.js';

/** @import {Site} from '../../shared/api_types.js' */
/** @import {CameraDiagnostics, CameraPicture} from '../api_types.js' */
/** @import {Point} from './camera_pixels.js' */
/** @import {MarkedPoint} from './marking_stage.js' */

/**
 * @typedef {object} MarkActions
 * @property {(point: Point) => void} mark a point
 * @property {() => void} undo
 * @property {() => void} chosen called when another camera was chosen, or has become known
 */

export class MarkedPicture {
  /** @type {Map<string, CameraPicture | null>} by camera */
  #pictures = new Map();
  #stage;
  /** @type {HTMLSelectElement} */
  #select;
  /** @type {HTMLImageElement} */
  #image;
  #message;
  #chosen;

  /**
   * @param {string} prefix of the ids of its elements
   * @param {Site} site
   * @param {MarkActions} actions
   */
  constructor(prefix, site, actions) {
    this.#select = element(`${prefix}-camera`);
    this.#image = element(`${prefix}-image`);
    this.#message = element(`${prefix}-message`);
    this.#chosen = actions.chosen;
    const mark = (/** @type {Point} */ point) => {
      if (this.#picture) actions.mark(toCameraPixels(point, this.#picture));
    };
    this.#stage = new MarkingStage(element(`${prefix}-stage`), element(`${prefix}-drawing`), site, mark, actions.undo);
    this.#select.replaceChildren(...site.cameras.map((camera) => make('option', { value: camera, textContent: camera })));
    this.#select.addEventListener('change', () => {
      this.#show();
      actions.chosen();
    });
    element(`${prefix}-picture`).addEventListener('click', () => void this.#load());
  }

  get camera() {
    return this.#select.value;
  }

  get #picture() {
    return this.#pictures.get(this.camera) ?? null;
  }

  /** Load what is known of the cameras' pictures, and show one. */
  async open() {
    await this.#loadSizes();
    this.#show();
  }

  async #loadSizes() {
    /** @type {{cameras: CameraDiagnostics[]}} */
    const { cameras } = await requestOperator('cameras');
    for (const { camera, picture } of cameras) this.#pictures.set(camera, picture);
  }

  /** @param {Point[][]} areas */
  drawAreas(areas) {
    const picture = this.#picture;
    this.#stage.drawAreas(picture ? areas.map((area) => area.map((point) => toSitePixels(point, picture))) : []);
  }

  /** @param {MarkedPoint[]} points */
  drawPoints(points) {
    const picture = this.#picture;
    this.#stage.drawPoints(picture ? points.map((marked) => ({ ...marked, point: toSitePixels(marked.point, picture) })) : []);
  }

  /** @param {string} text */
  say(text) {
    setText(this.#message, text);
  }

  #show() {
    this.#image.removeAttribute('src');
    this.#image.alt = `A picture of ${this.camera}`;
    void this.#load();
  }

  async #load() {
    const { camera } = this;
    const loaded = await loadStill(this.#image, `cameras/${camera}/live.jpg`);
    if (loaded && !this.#picture) {
      await this.#loadSizes().catch(() => undefined); // it has started since
      this.#chosen();
    }
    if (camera !== this.camera) return;
    if (!loaded) this.say(`There is no picture of ${camera} now.`);
    else if (!this.#picture) this.say(`The size of ${camera}'s picture is not known yet. Take a new picture in a moment.`);
    else this.say('');
  }
}
