/** Marks in a camera's picture: areas to ignore, and points with known positions on the floor. */

import { ignoredAreasYaml, missingPoints, pointsFile, toCameraPixels, toSitePixels } from './mark_export.js';
import { requestOperator } from '../../shared/requests.js';
import { element, make, setText } from '../../shared/dom.js';
import { MarkingStage } from './marking_stage.js';
import { loadStill } from '../camera_stills.js';
import { copy } from '../../shared/tools.js';

/** @import {Site} from '../../shared/api_types.js' */
/** @import {CameraDiagnostics, CameraPicture, Setting} from '../api_types.js' */
/** @import {Point, PointPair} from './mark_export.js' */
/** @import {Section, ShowError} from '../section.js' */

/** @implements {Section} */
export class PictureMarks {
  /** @type {Map<string, CameraPicture | null>} by camera */
  #pictures = new Map();
  /** @type {Map<string, Point[][]>} areas to ignore, by camera; the last one is being drawn */
  #ignored = new Map();
  /** @type {Map<string, PointPair[]>} */
  #pairs = new Map();
  #configLoaded = false; // the areas of the configuration
  #stage;
  /** @type {HTMLSelectElement} */
  #select = element('mark-camera');
  /** @type {HTMLImageElement} */
  #image = element('mark-image');
  /** @type {HTMLTextAreaElement} */
  #lines = element('mark-lines');
  /** @type {HTMLInputElement} */
  #unit = element('mark-unit');
  #message = element('mark-message');
  #areasButton = element('mark-areas');

  /**
   * @param {Site} site
   * @param {ShowError} showError
   */
  constructor(site, showError) {
    this.site = site;
    this.showError = showError;
    const [stage, drawing] = [element('mark-stage'), element('mark-drawing')];
    this.#stage = new MarkingStage(stage, drawing, site, (point) => this.#mark(point), () => this.#undo());
    this.#select.replaceChildren(...site.cameras.map((camera) => make('option', { value: camera, textContent: camera })));
    this.#select.addEventListener('change', () => this.#showCamera());
    this.#areasButton.addEventListener('click', () => this.#setMode(true));
    element('mark-points').addEventListener('click', () => this.#setMode(false));
    element('mark-next').addEventListener('click', () => this.#nextArea());
    element('mark-undo').addEventListener('click', () => this.#undo());
    element('mark-clear').addEventListener('click', () => this.#clear());
    element('mark-picture').addEventListener('click', () => void this.#loadPicture());
    element('mark-copy').addEventListener('click', async () => {
      const copied = await copy(this.#lines.value);
      setText(this.#message, copied ? 'Copied.' : 'Select the lines and copy them.');
      if (!copied) this.#lines.select();
    });
    element('mark-download').addEventListener('click', () => this.#download());
    this.#unit.addEventListener('input', () => this.#show());
  }

  open() {
    void this.#loadConfig();
  }

  close() {}

  get #camera() {
    return this.#select.value;
  }

  get #markingAreas() {
    return this.#areasButton.getAttribute('aria-pressed') === 'true';
  }

  get #picture() {
    return this.#pictures.get(this.#camera) ?? null;
  }

  async #loadConfig() {
    try {
      const [{ cameras }, { settings }] = await Promise.all([requestOperator('cameras'), requestOperator('config')]);
      for (const { camera, picture } of /** @type {CameraDiagnostics[]} */ (cameras)) this.#pictures.set(camera, picture);
      for (const { key, value } of /** @type {Setting[]} */ (settings)) {
        const [section, camera, name] = key.split('.');
        const isArea = section === 'cameras' && name === 'ignore' && !this.#configLoaded;
        if (isArea) this.#ignored.set(camera, [...JSON.parse(value), []]); // YAML lists of numbers are JSON
      }
      this.#configLoaded = true;
      this.#showCamera();
    } catch (error) {
      this.showError(error);
    }
  }

  #showCamera() {
    this.#image.removeAttribute('src');
    this.#image.alt = `A picture of ${this.#camera}`;
    void this.#loadPicture();
    this.#show();
  }

  async #loadPicture() {
    const camera = this.#camera;
    const loaded = await loadStill(this.#image, `cameras/${camera}/live.jpg`);
    if (camera !== this.#camera) return;
    if (!loaded) setText(this.#message, `There is no picture of ${camera} now.`);
    else if (!this.#picture) setText(this.#message, `The size of ${camera}'s picture is not known yet. Open this section again.`);
    else setText(this.#message, '');
  }

  /** @param {boolean} areas */
  #setMode(areas) {
    this.#areasButton.setAttribute('aria-pressed', String(areas));
    element('mark-points').setAttribute('aria-pressed', String(!areas));
    this.#show();
  }

  /** @param {Point} sitePoint in the site's picture */
  #mark(sitePoint) {
    const picture = this.#picture;
    if (!picture) return;
    const point = toCameraPixels(sitePoint, picture);
    if (this.#markingAreas) this.#cameraAreas()[this.#cameraAreas().length - 1].push(point);
    else this.#cameraPairs().push({ image: point, floor: ['', ''] });
    this.#show();
    if (!this.#markingAreas) this.#message.textContent = `Pair ${this.#cameraPairs().length}: where is it on the floor?`;
  }

  #nextArea() {
    const areas = this.#cameraAreas();
    if (areas[areas.length - 1].length) areas.push([]);
    this.#show();
  }

  #undo() {
    if (!this.#markingAreas) this.#cameraPairs().pop();
    else {
      const areas = this.#cameraAreas();
      if (!areas[areas.length - 1].length && areas.length > 1) areas.pop();
      areas[areas.length - 1].pop();
    }
    this.#show();
  }

  #clear() {
    if (this.#markingAreas) this.#ignored.set(this.#camera, [[]]);
    else this.#pairs.set(this.#camera, []);
    this.#show();
  }

  /** @returns {Point[][]} at least one; the last is being drawn */
  #cameraAreas() {
    const areas = this.#ignored.get(this.#camera) ?? [[]];
    this.#ignored.set(this.#camera, areas);
    return areas;
  }

  /** @returns {PointPair[]} */
  #cameraPairs() {
    const pairs = this.#pairs.get(this.#camera) ?? [];
    this.#pairs.set(this.#camera, pairs);
    return pairs;
  }

  #show() {
    element('mark-next').hidden = !this.#markingAreas;
    element('mark-table').hidden = element('mark-download').hidden = this.#markingAreas;
    element('mark-help').textContent = this.#markingAreas
      ? 'Press the corners of the area to ignore in order. The lines below replace those of the configuration.'
      : 'Press a point on the floor and enter its position below. The file is for: myview calibrate points.json --out ground.json';
    if (!this.#markingAreas) this.#showPairs();
    this.#showExport();
    this.#draw();
  }

  #showExport() {
    const areas = this.#markingAreas;
    this.#lines.value = areas ? ignoredAreasYaml(this.#camera, this.#cameraAreas()) : pointsFile(this.#pairs, this.#unit.value);
    if (!areas) setText(this.#message, missingPoints(this.#camera, this.#cameraPairs()));
  }

  #showPairs() {
    const body = element('mark-pairs');
    const rows = this.#cameraPairs().map((pair, at) => {
      const inputs = ['x', 'y'].map((axis, side) => {
        const input = make('input', { type: 'text', inputMode: 'decimal', autocomplete: 'off', value: pair.floor[side] });
        input.ariaLabel = `Pair ${at + 1}, ${axis} on the floor`;
        input.addEventListener('input', () => {
          pair.floor[side] = input.value;
          this.#showExport();
        });
        return make('td', {}, input);
      });
      return make('tr', {}, make('th', { scope: 'row', textContent: String(at + 1) }), make('td', { textContent: pair.image.join(', ') }), ...inputs);
    });
    body.replaceChildren(...rows);
  }

  #draw() {
    const picture = this.#picture;
    if (!picture) this.#stage.drawPoints([]);
    else if (this.#markingAreas) this.#stage.drawAreas(this.#cameraAreas().map((area) => area.map((point) => toSitePixels(point, picture))));
    else this.#stage.drawPoints(this.#cameraPairs().map(({ image }) => toSitePixels(image, picture)));
  }

  #download() {
    const address = URL.createObjectURL(new Blob([this.#lines.value], { type: 'application/json' }));
    make('a', { href: address, download: 'points.json' }).click();
    setTimeout(() => URL.revokeObjectURL(address), 1000);
  }
}
