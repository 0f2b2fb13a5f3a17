/** Areas of a camera's picture in which no one is detected, drawn as lines for the configuration. */

import { ignoredAreasYaml } from './camera_pixels.js';
import { requestOperator } from '../../shared/requests.js';
import { element } from '../../shared/dom.js';
import { MarkedPicture } from './marked_picture.js';
import { copy } from '../../shared/tools.js';

/** @import {Site} from '../../shared/api_types.js' */
/** @import {Setting} from '../api_types.js' */
/** @import {Point} from './camera_pixels.js' */
/** @import {Section, ShowError} from '../section.js' */

/** @implements {Section} */
export class IgnoredAreas {
  /** @type {Map<string, Point[][]>} by camera; the last one is being drawn */
  #ignored = new Map();
  #configLoaded = false; // the areas of the configuration
  #picture;
  /** @type {HTMLTextAreaElement} */
  #lines = element('mark-lines');

  /**
   * @param {Site} site
   * @param {ShowError} showError
   */
  constructor(site, showError) {
    this.showError = showError;
    this.#picture = new MarkedPicture('mark', site, {
      mark: (point) => this.#mark(point),
      undo: () => this.#undo(),
      chosen: () => this.#show(),
    });
    element('mark-next').addEventListener('click', () => this.#nextArea());
    element('mark-undo').addEventListener('click', () => this.#undo());
    element('mark-clear').addEventListener('click', () => this.#clear());
    element('mark-copy').addEventListener('click', async () => {
      const copied = await copy(this.#lines.value);
      this.#picture.say(copied ? 'Copied.' : 'Select the lines and copy them.');
      if (!copied) this.#lines.select();
    });
  }

  open() {
    void this.#loadConfig();
  }

  close() {}

  async #loadConfig() {
    try {
      const [{ settings }] = await Promise.all([requestOperator('config'), this.#picture.open()]);
      for (const { key, value } of /** @type {Setting[]} */ (settings)) {
        const [section, camera, name] = key.split('.');
        const isArea = section === 'cameras' && name === 'ignore' && !this.#configLoaded;
        if (isArea) this.#ignored.set(camera, [...JSON.parse(value), []]); // YAML lists of numbers are JSON
      }
      this.#configLoaded = true;
      this.#show();
    } catch (error) {
      this.showError(error);
    }
  }

  /** @param {Point} point */
  #mark(point) {
    const areas = this.#cameraAreas();
    areas[areas.length - 1].push(point);
    this.#show();
  }

  #nextArea() {
    const areas = this.#cameraAreas();
    if (areas[areas.length - 1].length) areas.push([]);
    this.#show();
  }

  #undo() {
    const areas = this.#cameraAreas();
    if (!areas[areas.length - 1].length && areas.length > 1) areas.pop();
    areas[areas.length - 1].pop();
    this.#show();
  }

  #clear() {
    this.#ignored.set(this.#picture.camera, [[]]);
    this.#show();
  }

  /** @returns {Point[][]} at least one; the last is being drawn */
  #cameraAreas() {
    const { camera } = this.#picture;
    const areas = this.#ignored.get(camera) ?? [[]];
    this.#ignored.set(camera, areas);
    return areas;
  }

  #show() {
    this.#lines.value = ignoredAreasYaml(this.#picture.camera, this.#cameraAreas());
    this.#picture.drawAreas(this.#cameraAreas());
  }
}
