/** The floor plan: the area that each camera covers, zones, and people's positions and tracks of the last seconds. */

import { shortLabel } from '../people/names.js';
import { requestOperator } from '../shared/requests.js';
import { element, make, setLines, setText, svg } from '../shared/dom.js';
import { Repeater } from './section.js';
import { describeCalibration, drawCoverage, drawTrack } from './floor_drawing.js';
import { FloorTracks } from './floor_tracks.js';
import { FloorZones } from './floor_zones.js';

/** @import {Gop, Site} from '../shared/api_types.js' */
/** @import {Floor, FloorCamera} from './api_types.js' */
/** @import {Section, ShowError} from './section.js' */
/** @import {FloorTrack} from './floor_tracks.js' */
/** @import {Palette} from '../people/palette.js' */

const INTERVAL_MS = 5000; // the covered areas change when a camera starts

/** @implements {Section} */
export class FloorPlan {
  /** @type {FloorCamera[]} */
  #cameras = [];
  #tracks;
  #zones = new FloorZones();
  #repeater;
  #open = false;
  #drawnFloor = '';
  #size = 1;
  #people = svg('g');

  /**
   * @param {Site} site
   * @param {Palette} palette
   * @param {ShowError} showError
   */
  constructor(site, palette, showError) {
    this.palette = palette;
    this.#tracks = new FloorTracks(site);
    this.#repeater = new Repeater(() => this.#refresh(), INTERVAL_MS, showError);
    // Tracks are collected before the section is opened.
    void this.load().catch(() => undefined);
  }

  open() {
    this.#open = true;
    this.#repeater.start();
  }

  close() {
    this.#open = false;
    this.#repeater.stop();
  }

  /** @returns {FloorTrack[]} people's tracks of the last seconds */
  get tracks() {
    return this.#tracks.tracks;
  }

  /** @returns {Promise<Floor>} what the cameras cover now */
  async load() {
    /** @type {Floor} */
    const floor = await requestOperator('floor');
    this.#cameras = floor.cameras;
    return floor;
  }

  /** @param {Gop} gop */
  add(gop) {
    this.#tracks.add(gop, this.#cameras);
    if (this.#open) this.#showTracks();
  }

  async #refresh() {
    const floor = await this.load();
    const json = JSON.stringify(floor);
    if (json !== this.#drawnFloor) this.#draw(floor);
    this.#drawnFloor = json;
    await this.#zones.refresh(this.#size);
    this.#showTracks();
  }

  /** @param {Floor} floor */
  #draw(floor) {
    const coverage = drawCoverage(floor, this.palette);
    const plan = element('plan');
    plan.toggleAttribute('hidden', !coverage);
    const calibrated = floor.cameras.filter(({ outline }) => outline.length > 0).length;
    setText(element('floor-message'), describeCalibration(calibrated, floor.uncalibrated));
    element('floor-cameras').replaceChildren(...floor.cameras.map(({ camera }) => make('li', {}, this.#chip(camera))));
    if (!coverage) return;
    this.#size = coverage.size;
    plan.setAttribute('viewBox', coverage.viewBox);
    plan.replaceChildren(...coverage.areas, this.#zones.drawing, this.#people);
  }

  #showTracks() {
    const tracks = this.#tracks.tracks;
    const size = this.#size;
    this.#people.replaceChildren(...tracks.flatMap((track) => drawTrack(track, size)));
    const lines = tracks.map(({ object, positions, cameras }) => {
      const [x, y] = positions[positions.length - 1];
      return `${shortLabel(object)} at ${x.toFixed(2)}, ${y.toFixed(2)}, seen by ${cameras.join(', ')}`;
    });
    const list = element('positions');
    setLines(list, lines);
    const heading = element('floor').querySelector('h2') ?? list;
    setText(heading, tracks.length ? 'On the floor now' : 'No one is on the floor now');
  }

  /** @param {string} camera */
  #chip(camera) {
    const chip = make('span', { className: 'chip', textContent: camera });
    chip.style.setProperty('--camera', this.palette.color(camera));
    return chip;
  }
}
