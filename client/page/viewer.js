/** What the page knows and what follows from it: the one place where the parts meet. */

import { onAddress, watchedInAddress, writeAddress } from './address.js';
import { Beside } from './beside.js';
import { Decisions } from './decisions.js';
import { Framing } from './framing.js';
import { Kept } from './kept.js';
import { Notice } from './notice.js';
import { Override } from './override.js';
import { Palette } from './palette.js';
import { Past } from './past.js';
import { playerOf } from './players.js';
import { Probe } from './probe.js';
import { Recall } from './recall.js';
import { describe } from './status.js';

/** @import {Box, Camera, Gop, Person, Site} from './contract.js' */
/** @import {Part} from './follow.js' */
/** @import {Frame} from './frames.js' */
/** @import {View} from './kept.js' */
/** @import {Form} from './players.js' */
/** @import {Subject} from './subject.js' */
/** @import {Status} from './status.js' */

const STANDING_MS = 1500; // without a new frame the picture counts as standing
const RECENT_S = 10; // after this out of view a person belongs to the earlier ones
const LIVE_S = 2; // who is less behind the newest decision than this is live
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
  past = new Past();
  framing = new Framing();
  notice = new Notice();
  palette = new Palette([]);
  decisions = new Decisions(1);
  kept = new Kept();
  probe = new Probe();
  connected = false;
  supported = true;
  /** @type {Form} */
  form = { container: 'mp4', codec: '', pulse0: null };
  boxesOn = true;
  /** @type {Part | null} of the frame now shown, where the person is followed; null: all of it */
  part = null;
  mediaTime = 0; // seconds, of the frame now shown
  mapped = true; // it is known which pulse that is
  /** @type {Box[]} of the frame now shown */
  boxes = [];
  #asked = this.object !== null; // by the viewer, not by default
  #asleep = false; // paused by a browser that nobody looks at, not by hand
  #frameAt = -Infinity;
  #chosenAt = -Infinity;
  #stale = false; // the picture is of pulses that have begun anew since

  /**
   * @param {HTMLVideoElement} video
   * @param {() => void} changed something to show has changed
   */
  constructor(video, changed) {
    this.changed = changed;
    this.recall = new Recall(1, changed);
    this.player = playerOf(video, {
      landed: changed,
      ended: (refused) => (refused ? this.#losePast() : this.live()),
      resumed: () => (this.#asleep ? this.live() : this.#resume()),
    });
    video.addEventListener('pause', () => (this.#asleep = document.hidden));
    document.addEventListener('visibilitychange', () => {
      if (!document.hidden && this.#asleep && video.paused) this.live();
    });
    this.probe.object = this.object;
    onAddress((watched) => {
      if (this.override.take(watched)) this.#moveOn();
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
      this.recall = new Recall(site.fps, this.changed);
      this.kept.forget();
      this.#rename();
      this.past.leave();
      this.#stale = this.probe.pulse !== null;
    }
    this.override.configure(site.cameras);
    this.site = this.probe.site = site;
    this.palette = new Palette(site.cameras);
    const codec = site.sound ? `${site.codec},${site.sound}` : site.codec;
    this.form = { container: site.container ?? 'mp4', codec, pulse0: site.pulse0 };
    this.supported = this.player.configure(this.form);
    this.#play();
    this.changed();
  }

  /** @param {Person[]} people */
  setPeople(people) {
    this.people = people;
    this.#rename();
    this.#followMerge();
    const lost = this.object !== null && !this.chosen;
    if (this.object === null || (lost && !this.#asked)) this.#chooseDefault();
    this.#play();
    this.changed();
  }

  #rename() {
    for (const said of [this.decisions, this.recall.decisions]) said.rename(this.people ?? []);
  }

  /** @param {Camera[]} cameras */
  setCameras(cameras) {
    this.cameras = cameras;
    this.changed();
  }

  /** @param {Gop} gop */
  addGop(gop) {
    this.decisions.add(gop);
    for (const { kept, parted, camera } of gop.split ?? []) {
      if (kept === this.object) this.say(`${camera} took somebody else for person ${kept}: that is person ${parted}.`);
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

  /**
   * @param {number} wanted pulse to see again, from there on
   * @param {boolean} resumed it is where the picture was paused
   */
  watchFrom(wanted, resumed = false) {
    if (!this.site || this.object === null || this.probe.pulse === null) return;
    const { fps } = this.site;
    const pulse = Math.max(0, wanted);
    if (this.#stale || pulse >= this.decisions.end - LIVE_S * fps) return this.live();
    if (this.form.container === 'webm') return this.#losePast(); // of such a site nothing is
    this.past.begin(pulse, fps, resumed);
    this.player.play();
    this.#play();
    this.changed();
  }

  /** From now on what happens now. */
  live() {
    this.past.leave();
    this.player.play();
    this.#play();
    this.changed();
  }

  /** @param {number} seconds to go on, or back, from the frame now shown */
  skip(seconds) {
    if (this.site && this.probe.pulse !== null) this.watchFrom(this.probe.pulse + Math.round(seconds * this.site.fps));
  }

  /** Stop the picture, or go on with it where it stopped. */
  pause() {
    const { video } = this.player;
    if (video.paused) this.#resume();
    else video.pause();
  }

  #resume() {
    if (this.probe.pulse === null) this.player.play();
    else this.watchFrom(this.probe.pulse, true);
  }

  /** Whoever is watched next, or by which camera, is watched from the moment of the past that is now shown. */
  #moveOn() {
    const { shown, video } = this.player;
    if (!this.site || shown?.past !== this.past.moment) return;
    this.past.moveOn(Math.floor(this.player.mediaTime(video.currentTime) * this.site.fps), this.site.fps);
  }

  #losePast() {
    // Who was paused after somebody had left has lost nothing: there is no picture of them since.
    const left = this.past.resumed && !this.chosen?.visible;
    if (!left) this.notice.say('Nothing is kept of that: this is live.');
    this.live();
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
    this.#moveOn();
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

  /** @param {Frame} frame */
  shown({ mediaTime, shownAt }) {
    const pulse = Math.round(this.player.mediaTime(mediaTime) * (this.site?.fps ?? 1));
    const passed = mediaTime - this.mediaTime;
    this.mediaTime = mediaTime;
    this.mapped = !Number.isNaN(pulse);
    if (!this.mapped) return this.#showUnmapped(shownAt);
    // The same moment may be shown again, of somebody else.
    if (pulse !== this.probe.pulse) {
      this.#frameAt = performance.now();
      this.#stale = false;
      this.probe.frame({ pulse, shownAt, delayMs: this.#delay(pulse, shownAt) });
    }
    if (!this.site || !this.player.shown) return;
    const { object } = this.player.shown;
    if (this.player.shown.past) this.recall.want(pulse, this.decisions.begin);
    const said = this.said(pulse);
    const camera = this.#camera(this.player.shown, said, pulse);
    this.probe.view(object, camera, shownAt);
    this.boxes = camera === null ? [] : said.boxes(camera, pulse);
    const box = this.boxes.find(([number]) => number === object);
    this.part = this.framing.step(`${object} ${camera}`, box, this.site, passed);
  }

  /**
   * It is not known which frame this is: it is shown, and nothing is said of it.
   *
   * @param {number} shownAt
   */
  #showUnmapped(shownAt) {
    this.#frameAt = performance.now();
    this.boxes = [];
    this.part = null;
    if (this.player.shown) this.probe.view(this.player.shown.object, null, shownAt);
  }

  /** @returns {boolean} whether a picture has been shown */
  get pictured() {
    return this.#frameAt > -Infinity;
  }

  /**
   * @param {Subject} subject
   * @param {Decisions} said
   * @param {number} pulse
   */
  #camera({ object, camera, prefer }, said, pulse) {
    if (camera !== null) return camera;
    return prefer === null ? said.camera(object, pulse) : said.preferring(object, prefer, pulse);
  }

  /**
   * @param {number} pulse
   * @returns {Decisions} what is known of that moment, lately decided or asked for again
   */
  said(pulse) {
    return pulse < this.decisions.begin ? this.recall.decisions : this.decisions;
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

  /** @returns {boolean} whether new frames are being shown */
  get flowing() {
    return performance.now() - this.#frameAt < STANDING_MS;
  }

  /** @returns {Status} */
  status() {
    const { flowing } = this;
    const status = describe({
      supported: this.supported,
      connected: this.connected,
      known: this.site !== null && this.people !== null,
      people: this.people?.length ?? 0,
      object: this.object,
      listed: this.chosen !== undefined,
      visible: this.chosen?.visible ?? false,
      paused: this.player.video.paused && this.pictured,
      moving: flowing && (this.player.shown?.object === this.object || performance.now() - this.#chosenAt < STANDING_MS),
    });
    this.probe.state = status.state;
    return status;
  }

  /** @type {number | null} milliseconds that the server's clock is ahead; set from outside */
  clockOffset = null;

  /**
   * @param {number} pulse
   * @param {number} shownAt
   */
  #delay(pulse, shownAt) {
    const { site, clockOffset } = this;
    if (!site || site.pulse0 === null || clockOffset === null) return null;
    return shownAt + clockOffset - (site.pulse0 + pulse / site.fps) * 1000;
  }

  /** Whoever was chosen by a number that is no longer theirs stays chosen by the one they have. */
  #followMerge() {
    const { object } = this;
    this.beside.rename(this.people);
    const same = this.people?.find((person) => object !== null && person.also?.includes(object));
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
    this.#moveOn();
    this.object = object;
    this.#chosenAt = performance.now();
    this.probe.choose(object);
    this.#play();
    this.changed();
  }

  #play() {
    if (!this.site || !this.supported || !this.people) return;
    if (this.object === null || !this.chosen) return this.player.stop();
    const past = this.past.moment;
    const { held, preferred } = this.override;
    this.player.choose({ object: this.object, camera: held, prefer: past ? null : preferred, past });
  }
}
