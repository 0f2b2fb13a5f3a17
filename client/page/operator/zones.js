/** Zones on a camera's picture: areas where nobody is looked for, and places that are known on the floor. */

import { ignoreLines, missing, pointsFile, toOwn, toSite } from './drawing.js';
import { ask } from './requests.js';
import { element, make, put } from './section.js';
import { MarkedPicture } from './picture.js';
import { load } from './stills.js';
import { copy } from '../shared/tools.js';

/** @import {Site} from '../shared/contract.js' */
/** @import {CameraDiagnostics, OwnPicture, Setting} from './contract.js' */
/** @import {Pair, Place} from './drawing.js' */
/** @import {Section, Tell} from './section.js' */

/** @implements {Section} */
export class ZoneEditor {
  /** @type {Map<string, OwnPicture | null>} by camera */
  #pictures = new Map();
  /** @type {Map<string, Place[][]>} areas to ignore, by camera; the last one is being drawn */
  #shapes = new Map();
  /** @type {Map<string, Pair[]>} */
  #pairs = new Map();
  #learned = false; // the areas of the configuration
  #marked;
  /** @type {HTMLSelectElement} */
  #select = element('mark-camera');
  /** @type {HTMLImageElement} */
  #image = element('mark-image');
  /** @type {HTMLTextAreaElement} */
  #lines = element('mark-lines');
  /** @type {HTMLInputElement} */
  #unit = element('mark-unit');
  #said = element('mark-said');
  #areas = element('mark-areas');

  /**
   * @param {Site} site
   * @param {Tell} tell
   */
  constructor(site, tell) {
    this.site = site;
    this.tell = tell;
    const [stage, drawing] = [element('mark-stage'), element('mark-drawing')];
    this.#marked = new MarkedPicture(stage, drawing, site, (place) => this.#mark(place), () => this.#undo());
    this.#select.replaceChildren(...site.cameras.map((it) => make('option', { value: it, textContent: it })));
    this.#select.addEventListener('change', () => this.#chooseCamera());
    this.#areas.addEventListener('click', () => this.#chooseKind(true));
    element('mark-points').addEventListener('click', () => this.#chooseKind(false));
    element('mark-next').addEventListener('click', () => this.#nextArea());
    element('mark-undo').addEventListener('click', () => this.#undo());
    element('mark-clear').addEventListener('click', () => this.#clear());
    element('mark-picture').addEventListener('click', () => void this.#takePicture());
    element('mark-copy').addEventListener('click', async () => {
      const done = await copy(this.#lines.value);
      put(this.#said, done ? 'Copied.' : 'Select the lines and copy them.');
      if (!done) this.#lines.select();
    });
    element('mark-download').addEventListener('click', () => this.#download());
    this.#unit.addEventListener('input', () => this.#show());
  }

  open() {
    void this.#learn();
  }

  close() {}

  get #camera() {
    return this.#select.value;
  }

  get #onAreas() {
    return this.#areas.getAttribute('aria-pressed') === 'true';
  }

  get #picture() {
    return this.#pictures.get(this.#camera) ?? null;
  }

  async #learn() {
    try {
      const [{ cameras }, { settings }] = await Promise.all([ask('cameras'), ask('config')]);
      for (const { camera, picture } of /** @type {CameraDiagnostics[]} */ (cameras)) this.#pictures.set(camera, picture);
      for (const { key, value } of /** @type {Setting[]} */ (settings)) {
        const [section, camera, name] = key.split('.');
        const known = section === 'cameras' && name === 'ignore' && !this.#learned;
        if (known) this.#shapes.set(camera, [...JSON.parse(value), []]); // such lists are JSON, too
      }
      this.#learned = true;
      this.#chooseCamera();
    } catch (error) {
      this.tell(error);
    }
  }

  #chooseCamera() {
    this.#image.removeAttribute('src');
    this.#image.alt = `A picture of ${this.#camera}`;
    void this.#takePicture();
    this.#show();
  }

  async #takePicture() {
    const camera = this.#camera;
    const there = await load(this.#image, `cameras/${camera}/live.jpg`);
    if (camera !== this.#camera) return;
    if (!there) put(this.#said, `There is no picture of ${camera} now.`);
    else if (!this.#picture) put(this.#said, `The size of ${camera}'s own picture is not known yet: open this section again.`);
    else put(this.#said, '');
  }

  /** @param {boolean} areas */
  #chooseKind(areas) {
    this.#areas.setAttribute('aria-pressed', String(areas));
    element('mark-points').setAttribute('aria-pressed', String(!areas));
    this.#show();
  }

  /** @param {Place} at in the site's picture */
  #mark(at) {
    const picture = this.#picture;
    if (!picture) return;
    const place = toOwn(at, picture);
    if (this.#onAreas) this.#areasHere()[this.#areasHere().length - 1].push(place);
    else this.#pairsHere().push({ image: place, floor: ['', ''] });
    this.#show();
    if (!this.#onAreas) this.#said.textContent = `Pair ${this.#pairsHere().length}: where is it on the floor?`;
  }

  #nextArea() {
    const areas = this.#areasHere();
    if (areas[areas.length - 1].length) areas.push([]);
    this.#show();
  }

  #undo() {
    if (!this.#onAreas) this.#pairsHere().pop();
    else {
      const areas = this.#areasHere();
      if (!areas[areas.length - 1].length && areas.length > 1) areas.pop();
      areas[areas.length - 1].pop();
    }
    this.#show();
  }

  #clear() {
    if (this.#onAreas) this.#shapes.set(this.#camera, [[]]);
    else this.#pairs.set(this.#camera, []);
    this.#show();
  }

  /** @returns {Place[][]} at least one, of which the last is being drawn */
  #areasHere() {
    const known = this.#shapes.get(this.#camera) ?? [[]];
    this.#shapes.set(this.#camera, known);
    return known;
  }

  /** @returns {Pair[]} */
  #pairsHere() {
    const known = this.#pairs.get(this.#camera) ?? [];
    this.#pairs.set(this.#camera, known);
    return known;
  }

  #show() {
    element('mark-next').hidden = !this.#onAreas;
    element('mark-table').hidden = element('mark-download').hidden = this.#onAreas;
    element('mark-how').textContent = this.#onAreas
      ? 'Press the corners of the area to ignore, one after the other. These lines replace those of the configuration.'
      : 'Press a place on the floor, and enter below where it is. The file is for: myview calibrate points.json --out ground.json';
    if (!this.#onAreas) this.#table();
    this.#write();
    this.#draw();
  }

  #write() {
    const areas = this.#onAreas;
    this.#lines.value = areas ? ignoreLines(this.#camera, this.#areasHere()) : pointsFile(this.#pairs, this.#unit.value);
    if (!areas) put(this.#said, missing(this.#camera, this.#pairsHere()));
  }

  #table() {
    const body = element('mark-pairs');
    const rows = this.#pairsHere().map((pair, at) => {
      const inputs = ['x', 'y'].map((axis, side) => {
        const input = make('input', { type: 'text', inputMode: 'decimal', autocomplete: 'off', value: pair.floor[side] });
        input.ariaLabel = `Pair ${at + 1}, ${axis} on the floor`;
        input.addEventListener('input', () => {
          pair.floor[side] = input.value;
          this.#write();
        });
        return make('td', {}, input);
      });
      return make('tr', {}, make('th', { scope: 'row', textContent: String(at + 1) }), make('td', { textContent: pair.image.join(', ') }), ...inputs);
    });
    body.replaceChildren(...rows);
  }

  #draw() {
    const picture = this.#picture;
    if (!picture) this.#marked.drawPoints([]);
    else if (this.#onAreas) this.#marked.drawAreas(this.#areasHere().map((area) => area.map((it) => toSite(it, picture))));
    else this.#marked.drawPoints(this.#pairsHere().map(({ image }) => toSite(image, picture)));
  }

  #download() {
    const address = URL.createObjectURL(new Blob([this.#lines.value], { type: 'application/json' }));
    make('a', { href: address, download: 'points.json' }).click();
    setTimeout(() => URL.revokeObjectURL(address), 1000);
  }
}
