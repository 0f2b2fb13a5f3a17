/** Where people stand: from the boxes of all cameras to places on the floor, and the ways of the last seconds. */

/** @import {Box, Gop} from '../shared/contract.js' */
/** @import {FloorCamera} from './contract.js' */

const TRAIL_S = 8;
const STEPS = 5; // places a second, of a way
const EDGE = 0.01; // of the picture's height: feet so near its lower edge are cut off

/**
 * @param {number[][]} homography 3x3
 * @param {number} x pixels
 * @param {number} y
 * @returns {[number, number] | null} the place; null: that is above the horizon
 */
export function place(homography, x, y) {
  const [X, Y, W] = homography.map(([a, b, c]) => a * x + b * y + c);
  return W > 0 ? [X / W, Y / W] : null;
}

/**
 * @typedef {object} Walker
 * @property {number} object
 * @property {[number, number][]} way places, the newest last
 * @property {string[]} cameras who see them at the newest
 */

export class Ways {
  /** @type {Map<number, {pulse: number, at: [number, number], cameras: string[]}[]>} by object */
  #ways = new Map();
  #end = 0; // the first pulse that nothing was said of

  /** @param {{fps: number, height: number}} site */
  constructor(site) {
    this.site = site;
    this.step = Math.max(1, Math.round(site.fps / STEPS));
  }

  /**
   * @param {Gop} gop
   * @param {FloorCamera[]} cameras
   */
  add(gop, cameras) {
    if (gop.first < this.#end - TRAIL_S * this.site.fps) {
      this.#ways.clear(); // pulses began anew
      this.#end = 0;
    }
    for (const { kept, lost } of gop.merged ?? []) {
      this.#ways.set(kept, this.#ways.get(kept) ?? this.#ways.get(lost) ?? []);
      this.#ways.delete(lost);
    }
    for (let at = 0; at < gop.frames; at += 1) {
      const pulse = gop.first + at;
      if (pulse % this.step === 0 && pulse >= this.#end) this.#stand(pulse, gop.boxes, at, cameras);
    }
    this.#end = Math.max(this.#end, gop.first + gop.frames);
    const oldest = this.#end - TRAIL_S * this.site.fps;
    for (const [object, way] of this.#ways) {
      while (way.length && way[0].pulse < oldest) way.shift();
      if (!way.length) this.#ways.delete(object);
    }
  }

  /**
   * @param {number} pulse
   * @param {Record<string, Box[][]>} boxes
   * @param {number} at which frame of them
   * @param {FloorCamera[]} cameras
   */
  #stand(pulse, boxes, at, cameras) {
    /** @type {Map<number, {sum: [number, number], cameras: string[]}>} */
    const seen = new Map();
    for (const { camera, homography } of cameras) {
      for (const [object, left, , right, bottom] of boxes[camera]?.[at] ?? []) {
        if (Math.abs(bottom / this.site.height - 1) < EDGE) continue;
        const where = place(homography, (left + right) / 2, bottom);
        if (!where) continue;
        const known = seen.get(object) ?? { sum: [0, 0], cameras: [] };
        seen.set(object, { sum: [known.sum[0] + where[0], known.sum[1] + where[1]], cameras: [...known.cameras, camera] });
      }
    }
    for (const [object, { sum, cameras: by }] of seen) {
      const way = this.#ways.get(object) ?? [];
      this.#ways.set(object, way);
      way.push({ pulse, at: [sum[0] / by.length, sum[1] / by.length], cameras: by });
    }
  }

  /** @returns {Walker[]} who was on the floor in the last seconds, by number */
  get walkers() {
    return [...this.#ways]
      .sort(([one], [other]) => one - other)
      .map(([object, way]) => ({ object, way: way.map(({ at }) => at), cameras: way[way.length - 1].cameras }));
  }
}
