/** What the page knows and what follows from it: the one place where the parts meet. */

import { onAddress, watchedInAddress, writeAddress } from './shared/address.js';
import { Beside } from './people/nearby_people.js';
import { Decisions } from './timeline/decisions.js';
import { Kept } from './timeline/available_past.js';
import { learnNames } from './people/names.js';
import { Notice } from './shared/notice.js';
import { CurrentFrame } from './player/current_frame.js';
import { Override } from './people/view_preference.js';
import { Palette } from './people/palette.js';
import { createPlayer } from './player/create_player.js';
import { Probe } from './player/probe.js';
import { PastDecisions } from './timeline/past_decisions.js';
import { describe } from './shared/status.js';
import { TimeShift } from './timeline/time_shift.js';

/** @import {Camera, Gop, Person, Site} from './shared/contract.js' */
/** @import {View} from './timeline/available_past.js' */
/** @import {StreamFormat} from './player/create_player.js' */
/** @import {Status} from './shared/status.js' */

const LANDING_MS = 1500; // for which the old picture may go on after somebody else was chosen
const RECENT_S = 10; // after this out of view a person belongs to the earlier ones
const RESTART_S = 1; // pulse 0 moved by more than this: the pulses began anew

export class Viewer {
  /** @type {Site | null} */
  site = null;
  /** @type {Person[] | null} */
  people = null;
  /** @type {Camera[]} */
  cameras = [];
  /** @type {number | null} */
  object = watchedInAddress().object;
  override = new Override(watchedInAddress());
  beside = new Beside(watchedInAddress().beside);
  currentFrame = new CurrentFrame(this);
  notice = new Notice();
  palette = new Palette([]);
  decisions = new Decisions(1);
  kept = new Kept();
  probe = new Probe();
  connected = false;
  supported = true;
  /** @type {StreamFormat} */
  format = { container: 'mp4', codec: '', pulse0: null, gopS: 0 };
  boxesOn = true;
  #asked = this.object !== null; // by the viewer, not by default
  #chosenAt = -Infinity;

  /**
   * @param {HTMLVideoElement} video
   * @param {() => void} changed something to show has changed
   */
  constructor(video, changed) {
    this.changed = changed;
    this.pastDecisions = new PastDecisions(1, changed);
    this.timeShift = new TimeShift(video, this);
    this.player = createPlayer(video, {
      switched: changed,
      ended: (refused) => this.timeShift.ended(refused),
      resumed: () => this.timeShift.resumed(),
    });
    this.probe.object = this.object;
    onAddress((watched) => {
      if (this.override.take(watched)) this.timeShift.moveOn();
      this.beside.numbers = watched.beside;
      if (watched.object !== null) this.#turnTo(watched.object, true);
      this.changed();
    });
  }

  /** @param {Site} site */
  setSite(site) {
    const old = this.site;
    const anew = !old || old.fps !== site.fps || Math.abs((old.pulse0 ?? 0) - (site.pulse0 ?? 0)) > RESTART_S;
    if (anew) {
      this.decisions = new Decisions(site.fps);
      this.pastDecisions = new PastDecisions(site.fps, this.changed);
      this.kept.forget();
      this.#rename();
      this.timeShift.beginAnew();
    }
    this.override.configure(site.cameras);
    this.site = this.probe.site = site;
    this.palette = new Palette(site.cameras);
    const codec = [site.codec, site.sound].filter(Boolean).join(',');
    this.format = { container: site.container ?? 'mp4', codec, pulse0: site.pulse0, gopS: site.gop / site.fps };
    // Before the first key frame nobody knows yet what there is to be played.
    this.supported = site.codec === null || this.player.configure(this.format);
    this.#play();
    this.changed();
  }

  /** @param {Person[]} people */
  setPeople(people) {
    this.people = people;
    learnNames(people);
    this.#rename();
    this.#followMerge();
    const lost = this.object !== null && !this.chosen;
    if (this.object === null || (lost && !this.#asked)) this.#chooseDefault();
    this.#play();
    this.changed();
  }

  #rename() {
    for (const said of [this.decisions, this.pastDecisions.decisions]) said.rename(this.people ?? []);
  }

  /** @param {Camera[]} cameras */
  setCameras(cameras) {
    this.cameras = cameras;
    this.changed();
  }

  /** @param {Gop} gop */
  addGop(gop) {
    this.decisions.add(gop);
    for (const { kept, new_object: split, camera } of gop.split ?? []) {
      if (kept === this.object) this.say(`${camera} took somebody else for person ${kept}: that is person ${split}.`);
    }
  }

  /** @param {boolean} connected */
  setConnected(connected) {
    this.connected = connected;
    this.changed();
  }

  /** @returns {Person | undefined} */
  get chosen() {
    return this.people?.find((person) => person.object === this.object);
  }

  /** @param {number} object as the viewer wishes */
  choose(object) {
    if (object !== this.object) this.override.hold(null);
    this.beside.swap(object, this.object);
    this.#turnTo(object, true);
    this.#write(true);
  }

  /** @param {string | null} camera to stay with; once more, or null: the best is shown again */
  hold(camera) {
    this.#change(() => this.override.hold(camera));
  }

  /** Prefer the camera that was held, or hold the one that was preferred. */
  prefer() {
    if (this.override.camera !== null) this.#change(() => this.override.toggle());
  }

  /** @param {() => void} change by which camera the chosen person is seen */
  #change(change) {
    if (this.object === null) return;
    this.timeShift.moveOn();
    change();
    this.#write(true);
    this.#play();
    this.changed();
  }

  /** @param {number} object to be seen beside the chosen person, or no more */
  toggleBeside(object) {
    this.beside.toggle(object, this.tiles);
    this.#write(true);
    this.changed();
  }

  /** @returns {number[]} those of them who have a stream */
  get tiles() {
    return this.beside.shown(this.people, this.object);
  }

  /** @param {number} by steps through those in view, around the end */
  step(by) {
    const shown = (this.people ?? []).filter((person) => person.visible || person.object === this.object);
    const numbers = shown.map((person) => person.object).sort((a, b) => a - b);
    if (!numbers.length) return;
    const at = numbers.indexOf(this.object ?? NaN);
    this.choose(numbers.at((at + by) % numbers.length) ?? numbers[0]);
  }

  /** @param {Person} person */
  isGone(person) {
    const fps = this.site?.fps ?? 1;
    return !person.visible && this.decisions.end - person.last_seen > RECENT_S * fps;
  }

  /**
   * @param {number} pulse
   * @returns {Decisions} what is known of that moment, lately decided or asked for again
   */
  decisionsAt(pulse) {
    return pulse < this.decisions.begin ? this.pastDecisions.decisions : this.decisions;
  }

  /**
   * @param {number} from pulse
   * @returns {View[]} what has been shown of the chosen person, and is decided
   */
  views(from) {
    const { object, decisions } = this;
    if (object === null) return [];
    return [...this.kept.between(from, decisions.begin), ...decisions.runs(object, from)];
  }

  /** @returns {Status} */
  status() {
    const { advancing, exists } = this.currentFrame;
    const landing = performance.now() - this.#chosenAt < LANDING_MS;
    const status = describe({
      supported: this.supported,
      connected: this.connected,
      known: this.site !== null && this.people !== null,
      people: this.people?.length ?? 0,
      object: this.object,
      listed: this.chosen !== undefined,
      visible: this.chosen?.visible ?? false,
      paused: this.player.video.paused && exists,
      moving: advancing && (landing || this.player.shown?.object === this.object),
    });
    this.probe.state = status.state;
    return status;
  }

  /** Whoever was chosen by a number that is no longer theirs stays chosen by the one they have. */
  #followMerge() {
    const { object } = this;
    this.beside.rename(this.people);
    const same = this.people?.find((person) => object !== null && person.aliases?.includes(object));
    if (!same || this.chosen) return;
    this.say(`Person ${object} turned out to be person ${same.object}.`);
    this.#turnTo(same.object, this.#asked);
    this.#write(false);
  }

  /** @param {string} text that is worth a moment's notice */
  say(text) {
    this.notice.say(text);
    this.changed();
  }

  #chooseDefault() {
    const first = this.people?.filter((person) => person.visible).sort((a, b) => a.object - b.object)[0];
    if (first) {
      this.#turnTo(first.object, false);
      this.#write(false);
    } else if (!this.#asked) {
      this.object = this.probe.object = null;
    }
  }

  /** @param {boolean} chosen by the viewer */
  #write(chosen) {
    writeAddress({ object: this.object, ...this.override.written, beside: this.beside.numbers }, chosen);
  }

  /**
   * @param {number} object
   * @param {boolean} asked
   */
  #turnTo(object, asked) {
    this.#asked = asked;
    if (object === this.object) {
      this.#play();
      return;
    }
    this.timeShift.moveOn();
    this.object = object;
    this.#chosenAt = performance.now();
    this.probe.select(object);
    this.#play();
    this.changed();
  }

  /** With the picture, from where it is wished for. */
  goOn() {
    this.player.play();
    this.#play();
    this.changed();
  }

  #play() {
    if (!this.site?.codec || !this.supported || !this.people) return;
    if (this.object === null || !this.chosen) return this.player.stop();
    const past = this.timeShift.moment;
    const { held, preferred } = this.override;
    this.player.select({ object: this.object, camera: held, prefer: past ? null : preferred, past });
  }
}
