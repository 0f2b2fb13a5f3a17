/** The floor plan: what the cameras cover, who is on the floor, and the ways of the last seconds. */

import { label } from '../people/names.js';
import { ask } from './requests.js';
import { element, make, put, Repeated, svg } from './section.js';
import { Ways } from './positions.js';

/** @import {Gop, Site} from '../shared/contract.js' */
/** @import {Floor, FloorCamera} from './contract.js' */
/** @import {Section, Tell} from './section.js' */
/** @import {Walker} from './positions.js' */
/** @import {Palette} from '../people/palette.js' */

const EVERY_MS = 5000; // the cameras' parts change when one comes that was not there
const MARGIN = 0.05; // of the plan
const DOT = 0.012;

/** @implements {Section} */
export class FloorPlan {
  /** @type {FloorCamera[]} */
  #cameras = [];
  #ways;
  #repeated;
  #open = false;
  #drawn = '';
  #size = 1;
  #people = svg('g');

  /**
   * @param {Site} site
   * @param {Palette} palette
   * @param {Tell} tell
   */
  constructor(site, palette, tell) {
    this.palette = palette;
    this.#ways = new Ways(site);
    this.#repeated = new Repeated(() => this.#ask(), EVERY_MS, tell);
    void ask('floor').then((floor) => (this.#cameras = floor.cameras), () => undefined); // ways begin at once
  }

  open() {
    this.#open = true;
    this.#repeated.start();
  }

  close() {
    this.#open = false;
    this.#repeated.stop();
  }

  /** @param {Gop} gop */
  add(gop) {
    this.#ways.add(gop, this.#cameras);
    if (this.#open) this.#show();
  }

  async #ask() {
    /** @type {Floor} */
    const floor = await ask('floor');
    this.#cameras = floor.cameras;
    const said = JSON.stringify(floor);
    if (said !== this.#drawn) this.#draw(floor);
    this.#drawn = said;
    this.#show();
  }

  /** @param {Floor} floor */
  #draw({ cameras, uncalibrated }) {
    const outlines = cameras.map(({ outline }) => outline).filter((it) => it.length > 0);
    element('plan').toggleAttribute('hidden', !outlines.length);
    put(element('floor-words'), words(outlines.length, uncalibrated));
    element('floor-cameras').replaceChildren(...cameras.map(({ camera }) => make('li', {}, this.#chip(camera))));
    if (!outlines.length) return;
    const corners = outlines.flat();
    const [left, right] = range(corners.map(([x]) => x));
    const [low, high] = range(corners.map(([, y]) => -y)); // up is up, on paper
    this.#size = Math.max(right - left, high - low);
    const margin = this.#size * MARGIN;
    const box = [left - margin, low - margin, right - left + 2 * margin, high - low + 2 * margin];
    const plan = element('plan');
    plan.setAttribute('viewBox', box.join(' '));
    const parts = cameras.map(({ camera, outline }) => {
      const colour = this.palette.colour(camera);
      return svg('polygon', { points: points(outline), fill: colour, stroke: colour, class: 'part' });
    });
    plan.replaceChildren(...parts, this.#people);
  }

  #show() {
    const walkers = this.#ways.walkers;
    const size = this.#size;
    this.#people.replaceChildren(...walkers.flatMap((it) => this.#walker(it, size)));
    const lines = walkers.map(({ object, way, cameras }) => {
      const [x, y] = way[way.length - 1];
      return `${label(object)} at ${x.toFixed(2)}, ${y.toFixed(2)}, seen by ${cameras.join(', ')}`;
    });
    const list = element('places');
    while (list.children.length > lines.length) list.lastChild?.remove();
    lines.forEach((line, at) => put(list.children[at] ?? list.appendChild(make('li')), line));
    put(element('floor').querySelector('h2') ?? list, walkers.length ? 'On the floor now' : 'No one is on the floor now');
  }

  /**
   * @param {Walker} walker
   * @param {number} size of the plan
   */
  #walker({ object, way }, size) {
    const [x, y] = way[way.length - 1];
    const name = svg('text', { x, y: -y - size * DOT * 1.6, 'font-size': size * 0.035, class: 'name' });
    name.textContent = label(object);
    return [
      svg('polyline', { points: points(way), class: 'way' }),
      svg('circle', { cx: x, cy: -y, r: size * DOT, class: 'walker' }),
      name,
    ];
  }

  /** @param {string} camera */
  #chip(camera) {
    const chip = make('span', { className: 'chip', textContent: camera });
    chip.style.setProperty('--camera', this.palette.colour(camera));
    return chip;
  }
}

/**
 * @param {number} parts that there are
 * @param {string[]} uncalibrated
 */
function words(parts, uncalibrated) {
  if (parts) return uncalibrated.length ? `Not calibrated: ${uncalibrated.join(', ')}.` : '';
  if (!uncalibrated.length) return 'No camera has reported yet.';
  return 'No camera is calibrated: mark the floor under Zones, or calibrate by a walk.';
}

/** @param {number[]} values */
function range(values) {
  return [Math.min(...values), Math.max(...values)];
}

/** @param {[number, number][]} places */
function points(places) {
  return places.map(([x, y]) => `${x},${-y}`).join(' ');
}
