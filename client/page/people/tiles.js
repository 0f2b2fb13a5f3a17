/** Others beside the chosen person: a small player each, live, with boxes on their own frames as in the large one. */

import { captureFrame, watchFrames } from '../player/frames.js';
import { label, person } from './names.js';
import { Overlay } from '../player/overlay.js';
import { createPlayer } from '../player/create_player.js';

/** @import {Decisions} from '../timeline/decisions.js' */
/** @import {Frame} from '../player/frames.js' */
/** @import {StreamFormat} from '../player/create_player.js' */
/** @import {Site} from '../shared/contract.js' */

/**
 * What all players of the page have in common.
 *
 * @typedef {object} Shared
 * @property {Site | null} site
 * @property {StreamFormat} format
 * @property {Decisions} decisions
 * @property {boolean} boxesOn
 */

export class Tiles {
  /** @type {Map<number, Tile>} */
  #tiles = new Map();

  /**
   * @param {HTMLElement} place
   * @param {Shared} shared
   * @param {(object: number) => void} choose the person of a tile that was pressed
   */
  constructor(place, shared, choose) {
    this.place = place;
    this.shared = shared;
    this.choose = choose;
  }

  /** @param {number[]} objects who is to be seen beside the chosen person */
  show(objects) {
    let focused = false;
    for (const [object, tile] of this.#tiles) {
      if (objects.includes(object)) continue;
      focused ||= tile.element === document.activeElement;
      tile.close();
      this.#tiles.delete(object);
    }
    for (const [at, object] of objects.entries()) {
      if (!this.#tiles.has(object) && this.shared.site) {
        const tile = new Tile(object, this.shared, () => this.choose(object));
        this.#tiles.set(object, tile);
        this.place.insertBefore(tile.element, this.place.children[at] ?? null);
        if (focused) tile.element.focus(); // it has the place of the one that was pressed
      }
      this.#tiles.get(object)?.call();
      this.#tiles.get(object)?.play();
    }
    this.place.hidden = this.#tiles.size === 0;
  }

  repaint() {
    for (const tile of this.#tiles.values()) tile.repaint();
  }
}

class Tile {
  #mediaTime = 0;
  #enough = new AbortController();

  /**
   * @param {number} object
   * @param {Shared} shared
   * @param {() => void} pressed
   */
  constructor(object, shared, pressed) {
    this.object = object;
    this.shared = shared;
    this.element = document.createElement('button');
    this.element.type = 'button';
    this.element.className = 'stage tile pictured';
    this.element.addEventListener('click', pressed);
    this.video = document.createElement('video');
    this.video.muted = this.video.autoplay = this.video.playsInline = true;
    const canvas = document.createElement('canvas');
    this.number = document.createElement('span');
    this.number.className = 'number';
    this.element.append(this.video, canvas, this.number);
    this.overlay = new Overlay(canvas);
    const [switched, resumed] = [() => this.repaint(), () => this.play()];
    this.player = createPlayer(this.video, { switched, resumed, ended: () => undefined });
    watchFrames(this.video, () => shared.boxesOn, (frame) => this.#paint(frame), this.#enough.signal);
  }

  /** What the person is called may have changed. */
  call() {
    const words = `${person(this.object)}: make large`;
    if (this.element.title === words) return;
    this.element.title = this.element.ariaLabel = words;
    this.number.textContent = label(this.object);
  }

  play() {
    if (!this.player.configure(this.shared.format)) return;
    this.player.select({ object: this.object, camera: null, prefer: null, past: null });
    // Nobody pauses it by hand: a browser did, unseen.
    if (this.player.shown && this.video.paused && !document.hidden) this.video.play().catch(() => undefined);
  }

  close() {
    this.#enough.abort();
    this.player.close();
    this.element.remove();
  }

  repaint() {
    if (this.player.shown) this.#paint({ ...captureFrame(this.video, this.#mediaTime, this.shared.boxesOn), shownAt: 0 });
  }

  /** @param {Frame} frame */
  #paint({ mediaTime, image }) {
    const { site, decisions, boxesOn } = this.shared;
    this.#mediaTime = mediaTime;
    if (site && boxesOn && !this.player.switching) {
      const pulse = Math.round(this.player.mediaTime(mediaTime) * site.fps); // may be not known: NaN
      const camera = decisions.camera(this.object, pulse);
      this.overlay.draw(camera === null ? [] : decisions.boxes(camera, pulse), this.object, site, image, null);
    } else this.overlay.clear();
    image?.close();
  }
}
