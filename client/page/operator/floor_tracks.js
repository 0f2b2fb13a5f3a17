/** People's tracks on the floor: foot points of the boxes of all cameras, averaged over cameras. */

/** @import {Box, Gop} from '../shared/api_types.js' */
/** @import {FloorCamera} from './api_types.js' */

const TRAIL_S = 8;
const RATE = 5; // positions per second
const EDGE = 0.01; // share of the picture's height: feet closer to its lower edge are cut off

/**
 * @param {number[][]} homography 3x3
 * @param {number} x pixels
 * @param {number} y
 * @returns {[number, number] | null} position on the floor; null: the point is above the horizon
 */
export function projectToFloor(homography, x, y) {
  const [X, Y, W] = homography.map(([a, b, c]) => a * x + b * y + c);
  return W > 0 ? [X / W, Y / W] : null;
}

/**
 * @typedef {object} FloorTrack
 * @property {number} object
 * @property {[number, number][]} positions the newest last
 * @property {string[]} cameras that detect the person at the newest
 */

export class FloorTracks {
  /** @type {Map<number, {pulse: number, position: [number, number], cameras: string[]}[]>} by object */
  #tracks = new Map();
  #end = 0; // the first pulse without decisions

  /** @param {{fps: number, height: number}} site */
  constructor(site) {
    this.site = site;
    this.step = Math.max(1, Math.round(site.fps / RATE));
  }

  /**
   * @param {Gop} gop
   * @param {FloorCamera[]} cameras
   */
  add(gop, cameras) {
    if (gop.first < this.#end - TRAIL_S * this.site.fps) {
      this.#tracks.clear(); // the pulses have restarted
      this.#end = 0;
    }
    for (const { kept, lost } of gop.merged ?? []) {
      this.#tracks.set(kept, this.#tracks.get(kept) ?? this.#tracks.get(lost) ?? []);
      this.#tracks.delete(lost);
    }
    for (let frame = 0; frame < gop.frames; frame += 1) {
      const pulse = gop.first + frame;
      if (pulse % this.step === 0 && pulse >= this.#end) this.#addPositions(pulse, gop.boxes, frame, cameras);
    }
    this.#end = Math.max(this.#end, gop.first + gop.frames);
    const oldest = this.#end - TRAIL_S * this.site.fps;
    for (const [object, track] of this.#tracks) {
      while (track.length && track[0].pulse < oldest) track.shift();
      if (!track.length) this.#tracks.delete(object);
    }
  }

  /**
   * @param {number} pulse
   * @param {Record<string, Box[][]>} boxes
   * @param {number} frame index into them
   * @param {FloorCamera[]} cameras
   */
  #addPositions(pulse, boxes, frame, cameras) {
    /** @type {Map<number, {sum: [number, number], cameras: string[]}>} */
    const sums = new Map();
    for (const { camera, homography } of cameras) {
      for (const [object, left, , right, bottom] of boxes[camera]?.[frame] ?? []) {
        if (Math.abs(bottom / this.site.height - 1) < EDGE) continue;
        const position = projectToFloor(homography, (left + right) / 2, bottom);
        if (!position) continue;
        const { sum: [x, y], cameras: seenBy } = sums.get(object) ?? { sum: [0, 0], cameras: [] };
        sums.set(object, { sum: [x + position[0], y + position[1]], cameras: [...seenBy, camera] });
      }
    }
    for (const [object, { sum, cameras: seenBy }] of sums) {
      const track = this.#tracks.get(object) ?? [];
      this.#tracks.set(object, track);
      track.push({ pulse, position: [sum[0] / seenBy.length, sum[1] / seenBy.length], cameras: seenBy });
    }
  }

  /** @returns {FloorTrack[]} of the last seconds, by number */
  get tracks() {
    return [...this.#tracks]
      .sort(([a], [b]) => a - b)
      .map(([object, track]) => ({
        object,
        positions: track.map(({ position }) => position),
        cameras: track[track.length - 1].cameras,
      }));
  }
}

/**
 * @param {[number, number][]} positions on the floor
 * @returns {string} the points of a drawing, whose y axis points down
 */
export function svgPoints(positions) {
  return positions.map(([x, y]) => `${x},${-y}`).join(' ');
}
