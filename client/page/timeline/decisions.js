/** What the server decided, by pulse: cameras, cuts and boxes of the last minute and a bit. */

/** @import {Box, Gop} from '../shared/contract.js' */

const KEPT_SECONDS = 75;

export class Decisions {
  /** @type {Gop[]} sorted by first pulse */
  #gops = [];
  /** @type {Map<number, number>} by a number that somebody once had: the one they have now */
  #now = new Map();
  /** @type {Map<number, number[]>} the other way */
  #once = new Map();

  /** @param {number} fps */
  constructor(fps) {
    this.keptFrames = KEPT_SECONDS * fps;
  }

  /** @param {Gop} gop may repeat one that is known: the server sends the last few on connecting */
  add(gop) {
    if (this.#gops.length && gop.first < this.#gops[0].first) this.#gops = []; // pulses began anew
    let at = this.#gops.length;
    while (at > 0 && this.#gops[at - 1].first >= gop.first) at -= 1;
    const known = this.#gops[at]?.first === gop.first;
    this.#gops.splice(at, known ? 1 : 0, gop);
    while (this.#gops[0].first < this.end - this.keptFrames) this.#gops.shift();
  }

  clear() {
    this.#gops = [];
  }

  /** @param {{object: number, aliases?: number[]}[]} people with the numbers that they once had: what was said of those is theirs */
  rename(people) {
    this.#once = new Map(people.map(({ object, aliases }) => [object, aliases ?? []]));
    this.#now = new Map(people.flatMap(({ object, aliases }) => (aliases ?? []).map((it) => [it, object])));
  }

  /**
   * @param {Gop | undefined} gop
   * @param {number} object
   * @returns {string | null}
   */
  #choice(gop, object) {
    const known = [object, ...(this.#once.get(object) ?? [])].find((it) => gop?.choices[it]);
    return known === undefined ? null : gop?.choices[known] ?? null;
  }

  /** The first pulse that nothing is decided for yet; 0 when nothing is known. */
  get end() {
    const last = this.#gops.at(-1);
    return last ? last.first + last.frames : 0;
  }

  /** The first pulse that something is known of; Infinity when nothing is. */
  get begin() {
    return this.#gops[0]?.first ?? Infinity;
  }

  /**
   * @param {number} pulse
   * @returns {Gop | undefined}
   */
  at(pulse) {
    // From the end: what is asked for is nearly always among the newest.
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
   * Which camera a stream shows that prefers one: as the server does it, by what is told of this GOP and of the
   * one before. It is that camera where it sees the person in more than half of the frames of both.
   *
   * @param {number} object
   * @param {string} camera
   * @param {number} pulse
   * @returns {string | null}
   */
  preferring(object, camera, pulse) {
    const gop = this.at(pulse);
    const before = gop && this.at(gop.first - 1);
    if (gop && [gop, before ?? gop].every((it) => this.#sees(it, camera, object))) return camera;
    return this.#choice(gop, object);
  }

  /**
   * @param {Gop} gop
   * @param {string} camera
   * @param {number} object
   */
  #sees(gop, camera, object) {
    const frames = gop.boxes[camera] ?? [];
    const seen = frames.filter((boxes) => boxes.some(([number]) => (this.#now.get(number) ?? number) === object));
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
    return boxes.map(([number, ...sides]) => [this.#now.get(number) ?? number, ...sides]);
  }

  /**
   * The bands of the strip: neighbouring GOPs of the same camera are one run.
   *
   * @param {number} object
   * @param {number} from pulse
   * @returns {{camera: string, first: number, end: number}[]}
   */
  runs(object, from) {
    /** @type {{camera: string, first: number, end: number}[]} */
    const runs = [];
    for (const gop of this.#gops) {
      const end = gop.first + gop.frames;
      const camera = this.#choice(gop, object);
      if (end <= from || !camera) continue;
      const last = runs.at(-1);
      if (last && last.camera === camera && last.end === gop.first) last.end = end;
      else runs.push({ camera, first: Math.max(gop.first, from), end });
    }
    return runs;
  }
}
