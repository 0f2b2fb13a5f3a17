/** The floor plan: the area that each camera covers, zones, and people's positions and tracks of the last seconds. */

import { shortLabel } from '../people/names.js';
import { requestOperator } from '../shared/requests.js';
import { element, make, setLines, setText, svg } from '../shared/dom.js';
import { Repeater } from './section.js';
import { FloorTracks, svgPoints } from './floor_tracks.js';
import { FloorZones } from './floor_zones.js';

/** @import {Gop, Site} from '../shared/api_types.js' */
/** @import {Floor, FloorCamera} from './api_types.js' */
/** @import {Section, ShowError} from './section.js' */
/** @import {FloorTrack} from './floor_tracks.js' */
/** @import {Palette} from '../people/palette.js' */

const INTERVAL_MS = 5000; // the covered areas change when a camera starts
const MARGIN = 0.05; // share of the plan's size
const DOT = 0.012; // likewise

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
    void requestOperator('floor').then((floor) => (this.#cameras = floor.cameras), () => undefined);
  }

  open() {
    this.#open = true;
    this.#repeater.start();
  }

  close() {
    this.#open = false;
    this.#repeater.stop();
  }

  /** @param {Gop} gop */
  add(gop) {
    this.#tracks.add(gop, this.#cameras);
    if (this.#open) this.#showTracks();
  }

  async #refresh() {
    /** @type {Floor} */
    const floor = await requestOperator('floor');
    this.#cameras = floor.cameras;
    const json = JSON.stringify(floor);
    if (json !== this.#drawnFloor) this.#draw(floor);
    this.#drawnFloor = json;
    await this.#zones.refresh(this.#size);
    this.#showTracks();
  }

  /** @param {Floor} floor */
  #draw({ cameras, uncalibrated }) {
    const outlines = cameras.map(({ outline }) => outline).filter((outline) => outline.length > 0);
    element('plan').toggleAttribute('hidden', !outlines.length);
    setText(element('floor-message'), describe(outlines.length, uncalibrated));
    element('floor-cameras').replaceChildren(...cameras.map(({ camera }) => make('li', {}, this.#chip(camera))));
    if (!outlines.length) return;
    const corners = outlines.flat();
    const [left, right] = range(corners.map(([x]) => x));
    const [low, high] = range(corners.map(([, y]) => -y)); // the y axis of SVG points down
    this.#size = Math.max(right - left, high - low);
    const margin = this.#size * MARGIN;
    const box = [left - margin, low - margin, right - left + 2 * margin, high - low + 2 * margin];
    const plan = element('plan');
    plan.setAttribute('viewBox', box.join(' '));
    const areas = cameras.map(({ camera, outline }) => {
      const color = this.palette.color(camera);
      return svg('polygon', { points: svgPoints(outline), fill: color, stroke: color, class: 'coverage' });
    });
    plan.replaceChildren(...areas, this.#zones.drawing, this.#people);
  }

  #showTracks() {
    const tracks = this.#tracks.tracks;
    const size = this.#size;
    this.#people.replaceChildren(...tracks.flatMap((track) => this.#drawTrack(track, size)));
    const lines = tracks.map(({ object, positions, cameras }) => {
      const [x, y] = positions[positions.length - 1];
      return `${shortLabel(object)} at ${x.toFixed(2)}, ${y.toFixed(2)}, seen by ${cameras.join(', ')}`;
    });
    const list = element('positions');
    setLines(list, lines);
    const heading = element('floor').querySelector('h2') ?? list;
    setText(heading, tracks.length ? 'On the floor now' : 'No one is on the floor now');
  }

  /**
   * @param {FloorTrack} track
   * @param {number} size of the plan
   */
  #drawTrack({ object, positions }, size) {
    const [x, y] = positions[positions.length - 1];
    const name = svg('text', { x, y: -y - size * DOT * 1.6, 'font-size': size * 0.035, class: 'name' });
    name.textContent = shortLabel(object);
    return [
      svg('polyline', { points: svgPoints(positions), class: 'track' }),
      svg('circle', { cx: x, cy: -y, r: size * DOT, class: 'dot' }),
      name,
    ];
  }

  /** @param {string} camera */
  #chip(camera) {
    const chip = make('span', { className: 'chip', textContent: camera });
    chip.style.setProperty('--camera', this.palette.color(camera));
    return chip;
  }
}

/**
 * @param {number} calibrated number of calibrated cameras
 * @param {string[]} uncalibrated
 */
function describe(calibrated, uncalibrated) {
  if (calibrated) return uncalibrated.length ? `Not calibrated: ${uncalibrated.join(', ')}.` : '';
  if (!uncalibrated.length) return 'No camera has reported yet.';
  return 'No camera is calibrated: mark the floor under Zones, or calibrate by a walk.';
}

/** @param {number[]} values */
function range(values) {
  return [Math.min(...values), Math.max(...values)];
}
