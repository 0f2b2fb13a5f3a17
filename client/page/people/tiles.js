/** Small live players for other people beside the selected one, with boxes on their own frames. */

import { captureFrame, watchFrames } from '../player/frames.js';
import { make } from '../shared/dom.js';
import { longLabel, shortLabel } from './names.js';
import { Overlay } from '../player/overlay.js';
import { createPlayer } from '../player/create_player.js';

/** @import {Decisions} from '../timeline/decisions.js' */
/** @import {Frame} from '../player/frames.js' */
/** @import {StreamFormat} from '../player/create_player.js' */
/** @import {Person, Site} from '../shared/api_types.js' */

const MAX_TILES = 3; // of six connections per server; the events, the large player and requests need the others

/**
 * State that all players of the page share.
 *
 * @typedef {object} PlayerContext
 * @property {Site | null} site
 * @property {StreamFormat} format
 * @property {Decisions} decisions
 * @property {boolean} boxesOn
 * @property {string | null} delay
 */

/** Which people are on tiles. */
export class TileSelection {
  /** @param {number[]} numbers */
  constructor(numbers) {
    this.numbers = numbers;
  }

  /**
   * @param {Person[] | null} people
   * @param {number | null} selected
   * @returns {number[]} those that have a stream
   */
  shown(people, selected) {
    const known = new Set(people?.map((person) => person.object));
    return this.numbers.filter((number) => number !== selected && known.has(number)).slice(-MAX_TILES);
  }

  /**
   * Add a person, or remove them.
   *
   * @param {number} object
   * @param {number[]} shown
   */
  toggle(object, shown) {
    const remaining = shown.filter((number) => number !== object);
    this.numbers = shown.includes(object) ? remaining : [...remaining.slice(1 - MAX_TILES), object];
  }

  /**
   * Put the previously selected person on the tile of the one selected now.
   *
   * @param {number} object
   * @param {number | null} previous
   */
  swap(object, previous) {
    this.numbers = this.numbers.map((number) => (number === object && previous !== null ? previous : number));
  }

  /** @param {Person[] | null} people whose aliases are replaced by their current numbers */
  renumber(people) {
    const current = (/** @type {number} */ number) => people?.find((person) => person.aliases?.includes(number))?.object;
    this.numbers = [...new Set(this.numbers.map((number) => current(number) ?? number))];
  }
}

export class Tiles {
  /** @type {Map<number, PersonTile>} */
  #tiles = new Map();

  /**
   * @param {HTMLElement} container
   * @param {PlayerContext} context
   * @param {(object: number) => void} select the person of a pressed tile
   */
  constructor(container, context, select) {
    this.container = container;
    this.context = context;
    this.select = select;
  }

  /** @param {number[]} objects the people on tiles */
  show(objects) {
    let focused = false;
    for (const [object, tile] of this.#tiles) {
      if (objects.includes(object)) continue;
      focused ||= tile.element === document.activeElement;
      tile.close();
      this.#tiles.delete(object);
    }
    for (const [at, object] of objects.entries()) {
      if (!this.#tiles.has(object) && this.context.site) {
        const tile = new PersonTile(object, this.context, () => this.select(object));
        this.#tiles.set(object, tile);
        this.container.insertBefore(tile.element, this.container.children[at] ?? null);
        if (focused) tile.element.focus(); // it replaces the pressed one
      }
      this.#tiles.get(object)?.showLabel();
      this.#tiles.get(object)?.play();
    }
    this.container.hidden = this.#tiles.size === 0;
  }

  repaint() {
    for (const tile of this.#tiles.values()) tile.repaint();
  }
}

class PersonTile {
  #mediaTime = 0;
  #closed = new AbortController();

  /**
   * @param {number} object
   * @param {PlayerContext} context
   * @param {() => void} pressed
   */
  constructor(object, context, pressed) {
    this.object = object;
    this.context = context;
    this.video = make('video', { muted: true, autoplay: true, playsInline: true });
    this.number = make('span', { className: 'number' });
    const canvas = make('canvas');
    const properties = { type: /** @type {const} */ ('button'), className: 'stage tile pictured' };
    this.element = make('button', properties, this.video, canvas, this.number);
    this.element.addEventListener('click', pressed);
    this.overlay = new Overlay(canvas);
    const [switched, resumed] = [() => this.repaint(), () => this.play()];
    this.player = createPlayer(this.video, { switched, resumed, ended: () => undefined });
    watchFrames(this.video, () => context.boxesOn, (frame) => this.#paint(frame), this.#closed.signal);
  }

  /** Show the person's number and name, which may have changed. */
  showLabel() {
    const title = `${longLabel(this.object)}: make large`;
    if (this.element.title === title) return;
    this.element.title = this.element.ariaLabel = title;
    this.number.textContent = shortLabel(this.object);
  }

  play() {
    if (!this.player.configure(this.context.format)) return;
    const { delay } = this.context;
    this.player.select({ object: this.object, camera: null, prefer: null, delay, past: null });
    // A tile has no pause button: the browser paused it while the page was hidden.
    if (this.player.shown && this.video.paused && !document.hidden) this.video.play().catch(() => undefined);
  }

  close() {
    this.#closed.abort();
    this.player.close();
    this.element.remove();
  }

  repaint() {
    if (!this.player.shown) return;
    this.#paint({ ...captureFrame(this.video, this.#mediaTime, this.context.boxesOn), shownAt: 0 });
  }

  /** @param {Frame} frame */
  #paint({ mediaTime, image }) {
    const { site, decisions, boxesOn } = this.context;
    this.#mediaTime = mediaTime;
    if (site && boxesOn && !this.player.isSwitching(mediaTime)) {
      const pulse = Math.round(this.player.mediaTime(mediaTime) * site.fps); // NaN: unknown
      const camera = decisions.camera(this.object, pulse);
      this.overlay.draw(camera === null ? [] : decisions.boxes(camera, pulse), this.object, site, image, null);
    } else this.overlay.clear();
    image?.close();
  }
}
