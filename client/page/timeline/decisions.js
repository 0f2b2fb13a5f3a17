/** The server's decisions of the last minute, by pulse: cameras, cuts and boxes. */

/** @import {Box, Gop} from '../shared/api_types.js' */
/** @import {View} from './recorded_views.js' */

const KEPT_SECONDS = 75;

export class Decisions {
  /** @type {Gop[]} sorted by first pulse */
  #gops = [];
  /** @type {Map<number, number>} current number by alias */
  #current = new Map();
  /** @type {Map<number, number[]>} aliases by current number */
  #aliases = new Map();

  /** @param {number} fps */
  constructor(fps) {
    this.keptFrames = KEPT_SECONDS * fps;
  }

  /** @param {Gop} gop may replace a known one: the server sends the last few on connecting */
  add(gop) {
    if (this.#gops.length && gop.first < this.#gops[0].first) this.#gops = []; // the pulses have restarted
    let at = this.#gops.length;
    while (at > 0 && this.#gops[at - 1].first >= gop.first) at -= 1;
    const known = this.#gops[at]?.first === gop.first;
    this.#gops.splice(at, known ? 1 : 0, gop);
    while (this.#gops[0].first < this.end - this.keptFrames) this.#gops.shift();
  }

  clear() {
    this.#gops = [];
  }

  /** @param {{object: number, aliases?: number[]}[]} people whose aliases' decisions count as theirs */
  rename(people) {
    this.#aliases = new Map(people.map(({ object, aliases }) => [object, aliases ?? []]));
    this.#current = new Map(people.flatMap(({ object, aliases }) => (aliases ?? []).map((alias) => [alias, object])));
  }

  /**
   * @param {Gop | undefined} gop
   * @param {number} object
   * @returns {string | null}
   */
  #choice(gop, object) {
    const number = [object, ...(this.#aliases.get(object) ?? [])].find((alias) => gop?.choices[alias]);
    return number === undefined ? null : gop?.choices[number] ?? null;
  }

  /** The first undecided pulse; 0: there are no decisions. */
  get end() {
    const last = this.#gops.at(-1);
    return last ? last.first + last.frames : 0;
  }

  /** The first pulse with a decision; Infinity: there are none. */
  get begin() {
    return this.#gops[0]?.first ?? Infinity;
  }

  /**
   * @param {number} pulse
   * @returns {Gop | undefined}
   */
  at(pulse) {
    // From the end: the newest are requested most often.
    for (let i = this.#gops.length - 1; i >= 0; i -= 1) {
      const gop = this.#gops[i];
      if (gop.first <= pulse) return pulse < gop.first + gop.frames ? gop : undefined;
    }
    return undefined;
  }

  /**
   * @param {number} object
   * @param {number} pulse
   * @returns {string | null} the camera
   */
  camera(object, pulse) {
    return this.#choice(this.at(pulse), object);
  }

  /**
   * Return the camera of a stream with a preferred camera, computed as the server does: the preferred one if it
   * sees the person in more than half of the frames of this GOP and of the one before.
   *
   * @param {number} object
   * @param {string} camera
   * @param {number} pulse
   * @returns {string | null}
   */
  preferring(object, camera, pulse) {
    const gop = this.at(pulse);
    const before = gop && this.at(gop.first - 1);
    if (gop && [gop, before ?? gop].every((candidate) => this.#sees(candidate, camera, object))) return camera;
    return this.#choice(gop, object);
  }

  /**
   * @param {Gop} gop
   * @param {string} camera
   * @param {number} object
   */
  #sees(gop, camera, object) {
    const frames = gop.boxes[camera] ?? [];
    const seen = frames.filter((boxes) => boxes.some(([number]) => (this.#current.get(number) ?? number) === object));
    return 2 * seen.length > frames.length;
  }

  /**
   * @param {string} camera
   * @param {number} pulse
   * @returns {Box[]}
   */
  boxes(camera, pulse) {
    const gop = this.at(pulse);
    const boxes = gop?.boxes[camera]?.[pulse - gop.first] ?? [];
    return boxes.map(([number, ...sides]) => [this.#current.get(number) ?? number, ...sides]);
  }

  /**
   * Return a person's views from a pulse on; adjacent GOPs of the same camera are merged.
   *
   * @param {number} object
   * @param {number} from pulse
   * @returns {View[]}
   */
  views(object, from) {
    /** @type {View[]} */
    const views = [];
    for (const gop of this.#gops) {
      const end = gop.first + gop.frames;
      const camera = this.#choice(gop, object);
      if (end <= from || !camera) continue;
      const last = views.at(-1);
      if (last?.camera === camera && last.end === gop.first) last.end = end;
      else views.push({ camera, first: Math.max(gop.first, from), end });
    }
    return views;
  }
}
