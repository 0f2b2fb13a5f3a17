/** Places on the floor with their positions, and where the cameras' pictures show them. */

/** @import {PointsFile} from '../api_types.js' */
/** @import {Point} from '../marking/camera_pixels.js' */

/**
 * @typedef {object} Place
 * @property {[string, string]} position x and y on the floor, as entered
 * @property {Map<string, Point>} seen by camera, pixels of its own picture
 */

const MIN_PLACES = 4;
const MAX_COORDINATE = 1e9;

export class PointMarks {
  /** @type {Place[]} */
  places = [];
  /** @type {{place: Place, camera: string}[]} in the order in which they were made */
  #made = [];

  /**
   * Mark a place in a picture, or move its mark.
   *
   * @param {string} camera
   * @param {Place | undefined} place undefined: a new one
   * @param {Point} point
   */
  mark(camera, place, point) {
    const marked = place ?? { position: ['', ''], seen: new Map() };
    if (!place) this.places.push(marked);
    marked.seen.set(camera, point);
    this.#made = this.#made.filter((made) => made.place !== marked || made.camera !== camera);
    this.#made.push({ place: marked, camera });
  }

  /** @param {string} camera whose last mark is removed */
  undo(camera) {
    const last = this.#made.findLast((made) => made.camera === camera);
    if (last) this.#unmark(last.place, camera);
  }

  /** @param {string} camera all of whose marks are removed */
  clear(camera) {
    for (const place of [...this.places]) this.#unmark(place, camera);
  }

  /** @param {Place} place */
  remove(place) {
    this.places = this.places.filter((other) => other !== place);
    this.#made = this.#made.filter((made) => made.place !== place);
  }

  /**
   * @param {Place} place
   * @param {string} camera
   */
  #unmark(place, camera) {
    place.seen.delete(camera);
    this.#made = this.#made.filter((made) => made.place !== place || made.camera !== camera);
    if (!place.seen.size && place.position.every((text) => text.trim() === '')) this.remove(place);
  }

  /**
   * @param {string} camera
   * @returns {Place[]} those that are marked in its picture, in the order of its points in the file
   */
  seenBy(camera) {
    return this.places.filter(({ seen }) => seen.has(camera));
  }

  /**
   * @param {string} unit of the floor
   * @returns {PointsFile} with the places that have a position
   */
  toFile(unit) {
    /** @type {PointsFile['cameras']} */
    const cameras = {};
    this.places.forEach(({ position, seen }, at) => {
      const floor = /** @type {[number, number]} */ (position.map(readNumber));
      if (!floor.every(Number.isFinite)) return;
      for (const [camera, image] of seen) (cameras[camera] ??= []).push({ image, floor, name: `place ${at + 1}` });
    });
    return { unit, cameras };
  }

  /**
   * Replace all marks by those of a file; pairs at one position are one place.
   *
   * @param {PointsFile['cameras']} cameras
   */
  load(cameras) {
    this.places = [];
    this.#made = [];
    /** @type {Map<string, Place[]>} by position */
    const known = new Map();
    for (const [camera, pairs] of Object.entries(cameras)) {
      for (const { image, floor } of pairs) {
        const there = known.get(floor.join()) ?? [];
        const place = there.find(({ seen }) => !seen.has(camera));
        this.mark(camera, place, image);
        if (place) continue;
        const added = this.places[this.places.length - 1];
        added.position = [String(floor[0]), String(floor[1])];
        known.set(floor.join(), [...there, added]);
      }
    }
  }

  /** @returns {object} for `restore` */
  save() {
    return this.places.map(({ position, seen }) => ({ position, seen: [...seen] }));
  }

  /**
   * @param {any} saved of `save`
   * @param {string[]} cameras of the site; marks in other ones' pictures are left out
   */
  restore(saved, cameras) {
    this.places = [];
    this.#made = [];
    for (const { position: [x, y], seen } of saved) {
      /** @type {Place} */
      const place = { position: [String(x), String(y)], seen: new Map() };
      this.places.push(place);
      for (const [camera, point] of seen) if (cameras.includes(camera)) this.mark(camera, place, point);
    }
  }

  /**
   * @param {string} camera
   * @returns {string} how many places are missing; empty: none
   */
  describeMissing(camera) {
    const count = this.seenBy(camera).length;
    return count < MIN_PLACES ? `${camera}: ${count} of at least ${MIN_PLACES} places; six or more show which one is wrong.` : '';
  }
}

/**
 * @param {string} text a decimal number, with a point or a comma
 * @returns {number} NaN: it is none
 */
export function readNumber(text) {
  return text.trim() === '' ? NaN : Number(text.trim().replace(',', '.'));
}

/**
 * @param {string} text
 * @returns {string} what is wrong with a coordinate; empty: nothing
 */
export function describeCoordinate(text) {
  if (text.trim() === '') return 'Enter where the place is on the floor.';
  const value = readNumber(text);
  if (!Number.isFinite(value)) return 'Enter a number, such as 2.5.';
  return Math.abs(value) > MAX_COORDINATE ? 'This is too far away.' : '';
}

/**
 * Map a pixel to the floor.
 *
 * @param {number[][]} homography 3x3
 * @param {Point} point
 * @returns {Point | null} to a thousandth; null: it is not on the floor
 */
export function toFloor(homography, [x, y]) {
  const [across, along, depth] = homography.map(([a, b, c]) => a * x + b * y + c);
  const down = homography[2][1] || homography[2][2]; // the floor is below the horizon
  if (!(depth * down > 0)) return null;
  return [round(across / depth), round(along / depth)];
}

/** @param {number} value */
function round(value) {
  return Math.round(value * 1000) / 1000 || 0; // no negative zero
}
