/** The state of the viewer's page: what the server sent, what is selected, and what follows from it. */

import { onAddressChange, readAddress, writeAddress } from './shared/address.js';
import { CurrentFrame } from './player/current_frame.js';
import { Decisions } from './timeline/decisions.js';
import { RecordedViews } from './timeline/recorded_views.js';
import { setNames } from './people/names.js';
import { setServers } from './shared/servers.js';
import { Notice } from './shared/notice.js';
import { ViewPreference } from './people/view_preference.js';
import { Palette } from './people/palette.js';
import { createPlayer } from './player/create_player.js';
import { PastDecisions } from './timeline/past_decisions.js';
import { Probe } from './player/probe.js';
import { describe } from './shared/status.js';
import { TileSelection } from './people/tiles.js';
import { TimeShift } from './timeline/time_shift.js';

/** @import {Camera, Gop, Person, Site, ViewerDelay} from './shared/api_types.js' */
/** @import {View} from './timeline/recorded_views.js' */
/** @import {StreamFormat} from './player/create_player.js' */
/** @import {Status} from './shared/status.js' */

const SWITCH_MS = 1500; // how long the previous person may be displayed after a selection
const RECENT_S = 10; // people out of view for longer are listed as earlier
const RESTART_S = 1; // pulse 0 moved by more than this: the pulses have restarted

export class Viewer {
  /** @type {Site | null} */
  site = null;
  /** @type {Person[] | null} */
  people = null;
  /** @type {Camera[]} */
  cameras = [];
  /** @type {number | null} the selected person */
  object = readAddress().object;
  preference = new ViewPreference(readAddress());
  tileSelection = new TileSelection(readAddress().beside);
  /** @type {string | null} the chosen delay; null: balanced */
  delay = readAddress().delay;
  /** @type {ViewerDelay[]} that the site offers */
  delays = [];
  currentFrame = new CurrentFrame(this);
  notice = new Notice();
  palette = new Palette([]);
  decisions = new Decisions(1);
  recordedViews = new RecordedViews();
  probe = new Probe();
  connected = false;
  supported = true;
  /** @type {StreamFormat} */
  format = { container: 'mp4', codec: '', transcoded: false, pulse0: null, gopS: 0 };
  boxesOn = true;
  #selectedByUser = this.object !== null; // or by default
  #selectedAt = -Infinity; // performance.now()

  /**
   * @param {HTMLVideoElement} video
   * @param {() => void} changed the page needs an update
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
    onAddressChange((view) => {
      if (this.preference.set(view)) this.timeShift.keepMoment();
      this.tileSelection.numbers = view.beside;
      this.delay = view.delay;
      if (view.object !== null) this.#setObject(view.object, true);
      this.changed();
    });
  }

  /** @param {Site} site */
  setSite(site) {
    const old = this.site;
    const restarted = !old || old.fps !== site.fps || Math.abs((old.pulse0 ?? 0) - (site.pulse0 ?? 0)) > RESTART_S;
    if (restarted) {
      this.decisions = new Decisions(site.fps);
      this.pastDecisions = new PastDecisions(site.fps, this.changed);
      this.recordedViews.clear();
      this.#renameDecisions();
      this.timeShift.pulsesRestarted();
    }
    setServers(site.others ?? [], site.gop / site.fps);
    this.preference.configure(site.blur ? [] : site.cameras);
    this.site = this.probe.site = site;
    this.palette = new Palette(site.cameras);
    this.supported = this.#configurePlayer(site);
    this.#updatePlayer();
    this.changed();
  }

  /**
   * Configure the player for the site's streams, or for what the server encodes anew where it cannot play them.
   *
   * @param {Site} site
   * @returns {boolean} whether it can play either
   */
  #configurePlayer(site) {
    const common = { pulse0: site.pulse0, gopS: site.gop / site.fps };
    const codecs = (/** @type {string | null | undefined} */ video) => [video, site.sound].filter(Boolean).join(',');
    this.format = { container: site.container ?? 'mp4', codec: codecs(site.codec), transcoded: false, ...common };
    // Before the first keyframe the codec is unknown.
    if (site.codec === null || this.player.configure(this.format)) return true;
    if (!site.h264) return false;
    this.format = { container: 'mp4', codec: codecs(site.h264), transcoded: true, ...common };
    return this.player.configure(this.format);
  }

  /** @param {Person[]} people */
  setPeople(people) {
    this.people = people;
    setNames(people);
    this.#renameDecisions();
    this.#followMerge();
    const missing = this.object !== null && !this.selected;
    if (this.object === null || (missing && !this.#selectedByUser)) this.#selectDefault();
    this.#updatePlayer();
    this.changed();
  }

  #renameDecisions() {
    for (const decisions of [this.decisions, this.pastDecisions.decisions]) decisions.rename(this.people ?? []);
  }

  /** @param {Camera[]} cameras */
  setCameras(cameras) {
    this.cameras = cameras;
    this.changed();
  }

  /** @param {ViewerDelay[]} delays */
  setDelays(delays) {
    this.delays = delays;
    // A token for one person has no live view.
    if (this.delay !== null && !delays.some(({ delay }) => delay === this.delay)) this.delay = null;
    this.#updatePlayer();
    this.changed();
  }

  /** @param {string | null} delay of live pictures; null: balanced */
  chooseDelay(delay) {
    this.delay = delay;
    this.#writeAddress(true);
    this.#updatePlayer();
    this.changed();
  }

  /** @param {Gop} gop */
  addGop(gop) {
    this.decisions.add(gop);
    for (const { kept, new_object: split, camera } of gop.split ?? []) {
      if (kept === this.object) this.showNotice(`${camera} mistook person ${split} for person ${kept}.`);
    }
  }

  /** @param {boolean} connected */
  setConnected(connected) {
    this.connected = connected;
    this.changed();
  }

  /** @returns {Person | undefined} */
  get selected() {
    return this.people?.find((person) => person.object === this.object);
  }

  /** @returns {boolean} whether the page goes with the selected person to another site */
  get follows() {
    return this.#selectedByUser && this.timeShift.moment === null && !this.selected?.visible;
  }

  /** @param {number} object selected by the user */
  select(object) {
    if (object !== this.object) this.preference.hold(null);
    this.tileSelection.swap(object, this.object);
    this.#setObject(object, true);
    this.#writeAddress(true);
  }

  /**
   * @param {number} object selected by the user, who may have left long ago
   * @param {number} pulse to play their best view from
   */
  selectAt(object, pulse) {
    this.select(object);
    this.hold(null);
    this.timeShift.watchFrom(pulse);
  }

  /** @param {string | null} camera to hold; the held one, or null: return to the best view */
  hold(camera) {
    if (this.site?.blur) return this.showNotice('People are blurred only in the best view.');
    this.#changePreference(() => this.preference.hold(camera));
  }

  /** Prefer the held camera, or hold the preferred one. */
  togglePrefer() {
    if (this.preference.camera !== null) this.#changePreference(() => this.preference.togglePrefer());
  }

  /** @param {() => void} change */
  #changePreference(change) {
    if (this.object === null) return;
    this.timeShift.keepMoment();
    change();
    this.#writeAddress(true);
    this.#updatePlayer();
    this.changed();
  }

  /** @param {number} object to show on a tile, or no longer */
  toggleTile(object) {
    this.tileSelection.toggle(object, this.tiles);
    this.#writeAddress(true);
    this.changed();
  }

  /** @returns {number[]} the people on tiles */
  get tiles() {
    return this.tileSelection.shown(this.people, this.object);
  }

  /** @param {number} by steps through the people in view, cyclically */
  step(by) {
    const shown = (this.people ?? []).filter((person) => person.visible || person.object === this.object);
    const numbers = shown.map((person) => person.object).sort((a, b) => a - b);
    if (!numbers.length) return;
    const at = numbers.indexOf(this.object ?? NaN);
    this.select(numbers.at((at + by) % numbers.length) ?? numbers[0]);
  }

  /** @param {Person} person */
  isGone(person) {
    const fps = this.site?.fps ?? 1;
    return !person.visible && this.decisions.end - person.last_seen > RECENT_S * fps;
  }

  /**
   * @param {number} pulse
   * @returns {Decisions} that cover the pulse: recent ones, or those requested again
   */
  decisionsAt(pulse) {
    return pulse < this.decisions.begin ? this.pastDecisions.decisions : this.decisions;
  }

  /**
   * @param {number} from pulse
   * @returns {View[]} of the selected person, displayed or decided
   */
  views(from) {
    const { object, decisions } = this;
    if (object === null) return [];
    return [...this.recordedViews.between(from, decisions.begin), ...decisions.views(object, from)];
  }

  /** @returns {Status} */
  status() {
    const { advancing, exists } = this.currentFrame;
    const switching = performance.now() - this.#selectedAt < SWITCH_MS;
    const status = describe({
      supported: this.supported,
      connected: this.connected,
      known: this.site !== null && this.people !== null,
      people: this.people?.length ?? 0,
      object: this.object,
      listed: this.selected !== undefined || this.timeShift.moment !== null,
      visible: this.timeShift.moment !== null || (this.selected?.visible ?? false),
      paused: this.player.video.paused && exists,
      moving: advancing && (switching || this.player.shown?.object === this.object),
    });
    this.probe.state = status.state;
    return status;
  }

  /** Keep the selected person selected when their number was merged into another. */
  #followMerge() {
    const { object } = this;
    this.tileSelection.renumber(this.people);
    const merged = this.people?.find((person) => object !== null && person.aliases?.includes(object));
    if (!merged || this.selected) return;
    this.showNotice(`Person ${object} is the same as person ${merged.object}.`);
    this.#setObject(merged.object, this.#selectedByUser);
    this.#writeAddress(false);
  }

  /** @param {string} text shown for some seconds */
  showNotice(text) {
    this.notice.show(text);
    this.changed();
  }

  #selectDefault() {
    const first = this.people?.filter((person) => person.visible).sort((a, b) => a.object - b.object)[0];
    if (first) {
      this.#setObject(first.object, false);
      this.#writeAddress(false);
    } else if (!this.#selectedByUser) {
      this.object = this.probe.object = null;
    }
  }

  /** @param {boolean} byUser */
  #writeAddress(byUser) {
    writeAddress({ object: this.object, ...this.preference.addressPart, beside: this.tileSelection.numbers, delay: this.delay }, byUser);
  }

  /**
   * @param {number} object
   * @param {boolean} byUser
   */
  #setObject(object, byUser) {
    this.#selectedByUser = byUser;
    if (object === this.object) {
      this.#updatePlayer();
      return;
    }
    this.timeShift.keepMoment();
    this.object = object;
    this.#selectedAt = performance.now();
    this.probe.select(object);
    this.#updatePlayer();
    this.changed();
  }

  /** Resume playback, from the moment that the time shift has set. */
  play() {
    this.player.play();
    this.#updatePlayer();
    this.changed();
  }

  #updatePlayer() {
    if (!this.site?.codec || !this.supported || !this.people) return;
    const past = this.timeShift.moment;
    if (this.object === null || !(this.selected || past)) return this.player.stop();
    const { held, preferred } = this.preference;
    const delay = past ? null : this.delay;
    this.player.select({ object: this.object, camera: held, prefer: past ? null : preferred, delay, past });
  }
}
