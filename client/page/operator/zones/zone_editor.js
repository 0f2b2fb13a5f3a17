/** Zones and their rules, drawn on the floor plan or in a camera's picture, and saved in the configuration file. */

import { describeCalibration, drawCoverage, drawTrack } from '../floor_drawing.js';
import { getJson, pause, requestOperator } from '../../shared/requests.js';
import { element, make, setText } from '../../shared/dom.js';
import { shortLabel } from '../../people/names.js';
import { loadStill } from '../camera_stills.js';
import { Repeater } from '../section.js';
import { ZoneForm } from './zone_form.js';
import { floorPlace, picturePlace, shapeOf } from './zone_shapes.js';
import { ZoneStage } from './zone_stage.js';

/** @import {Rules, Site} from '../../shared/api_types.js' */
/** @import {Palette} from '../../people/palette.js' */
/** @import {CameraDiagnostics, Floor, SiteZone, SiteZones, ZoneRule} from '../api_types.js' */
/** @import {FloorPlan} from '../floor_plan.js' */
/** @import {Coverage} from '../floor_drawing.js' */
/** @import {Section, ShowError} from '../section.js' */
/** @import {Place, Shape} from './zone_shapes.js' */

const INTERVAL_MS = 1000;
const APPLIED_TRIES = 12;
const APPLIED_EVERY_MS = 400;
const FLOOR = ''; // the value of the floor among the places
/** @type {Record<Shape['kind'], string>} */
const HELP = {
  area: 'Press the corners in order; drag a corner to move it. Or enter them below.',
  line: 'Press its two ends. “in” marks the inner side: drag it, or turn the direction. Or enter all below.',
};

/** @implements {Section} */
export class ZoneEditor {
  /** @type {SiteZone[]} */
  #zones = [];
  /** @type {ZoneRule[]} on no zone */
  #rules = [];
  #digest = ''; // of zones and rules, as they are listed
  #openedDigest = ''; // as they were when the form was opened
  /** @type {ZoneRule[]} on no zone, likewise */
  #openedRules = [];
  #unit = ''; // on the floor
  #editable = false;
  /** @type {Map<string, CameraDiagnostics['picture']>} by camera */
  #pictures = new Map();
  /** @type {{floor: Floor, coverage: Coverage | null, scale: number} | null} */
  #floor = null;
  /** @type {Place | null} */
  #place = null;
  /** @type {SiteZone | null} the zone that is edited; its name is empty if it is new */
  #selected = null;
  /** @type {Map<string, number[]>} people by zone */
  #people = new Map();
  #form;
  #stage;
  #repeater;
  /** @type {HTMLSelectElement} */
  #select = element('zone-place');
  /** @type {HTMLImageElement} */
  #image = element('zone-image');
  #state = element('zone-state');

  /**
   * @param {Site} site
   * @param {Palette} palette
   * @param {FloorPlan} plan
   * @param {ShowError} showError
   * @param {() => Promise<void>} fileChanged
   */
  constructor(site, palette, plan, showError, fileChanged) {
    this.site = site;
    this.palette = palette;
    this.plan = plan;
    this.showError = showError;
    this.fileChanged = fileChanged;
    this.#form = new ZoneForm(site.cameras, {
      save: (zone) => void this.#save(zone),
      saveSiteRules: (rules) => void this.#change('PUT', { zone: null, rules }),
      remove: () => void this.#remove(),
      cancel: () => this.#deselect(''),
      changed: () => this.#draw(),
    });
    this.#stage = new ZoneStage(element('zone-drawing'), {
      press: (point) => this.#form.press(point),
      move: (index, point) => this.#form.move(index, point),
      choose: (name) => !this.#selected && this.#edit(this.#zones.find(({ zone }) => zone === name)),
    });
    this.#repeater = new Repeater(() => this.#refresh(), INTERVAL_MS, showError);
    const places = [make('option', { value: FLOOR, textContent: 'the floor plan' })];
    this.#select.replaceChildren(...places, ...site.cameras.map((camera) => make('option', { value: camera, textContent: `${camera}'s picture` })));
    this.#select.addEventListener('change', () => {
      this.#deselect('');
      this.#showPlace();
    });
    for (const kind of /** @type {const} */ (['area', 'line'])) {
      element(`zone-new-${kind}`).addEventListener('click', () => this.#create(kind));
    }
    element('zone-anywhere').addEventListener('click', () => this.#editSiteRules());
    element('zone-picture').addEventListener('click', () => void this.#loadPicture());
  }

  open() {
    void this.#load();
    this.#repeater.start();
  }

  get isUnsaved() {
    return this.#form.isChanged;
  }

  close() {
    this.#repeater.stop();
  }

  async #load() {
    try {
      /** @type {[{cameras: CameraDiagnostics[]}, Floor, Rules, SiteZones]} */
      const [{ cameras }, floor, { units_per_meter: scale }, zones] = await Promise.all([
        requestOperator('cameras'), this.plan.load(), getJson('api/rules'), requestOperator('zones'),
      ]);
      for (const { camera, picture } of cameras) this.#pictures.set(camera, picture);
      const coverage = drawCoverage(floor, this.palette);
      if (!coverage && !this.#floor) this.#select.value = this.site.cameras[0]; // nothing can be drawn on the floor
      this.#floor = { floor, coverage, scale };
      this.#take(zones);
      this.#showPlace();
    } catch (error) {
      this.showError(error);
    }
  }

  /** @param {SiteZones} zones */
  #take({ unavailable, unit, zones, rules, digest }) {
    this.#unit = unit;
    this.#digest = digest;
    this.#zones = zones;
    this.#rules = rules;
    this.#editable = unavailable === '';
    this.#button('zone-anywhere').disabled = !this.#editable;
    setText(element('zones-unavailable'), unavailable && `Zones cannot be changed here: ${unavailable}`);
    this.#showList();
  }

  #showPlace() {
    const camera = this.#select.value;
    element('zone-stage').classList.toggle('on-floor', camera === FLOOR);
    this.#image.hidden = element('zone-picture').hidden = camera === FLOOR;
    if (camera === FLOOR) this.#showFloor();
    else this.#showPicture(camera);
    for (const kind of ['area', 'line']) this.#button(`zone-new-${kind}`).disabled = !this.#editable || !this.#place;
    this.#draw();
  }

  #showFloor() {
    if (!this.#floor) return;
    const { floor, coverage, scale } = this.#floor;
    this.#place = coverage && floorPlace(coverage.viewBox, scale, coverage.size, this.#unit);
    this.#stage.show(this.#place, coverage?.viewBox ?? '', coverage?.areas ?? []);
    setText(element('zone-help'), describeCalibration(coverage ? 1 : 0, floor.uncalibrated));
  }

  /** @param {string} camera */
  #showPicture(camera) {
    const picture = this.#pictures.get(camera) ?? null;
    this.#place = picture && picturePlace(camera, picture, this.site.width);
    this.#stage.show(this.#place, `0 0 ${this.site.width} ${this.site.height}`, []);
    setText(element('zone-help'), picture ? '' : `The size of ${camera}'s picture is not known yet. Open this section again.`);
    this.#image.removeAttribute('src');
    this.#image.alt = `A picture of ${camera}`;
    void this.#loadPicture();
  }

  async #loadPicture() {
    const camera = this.#select.value;
    const loaded = await loadStill(this.#image, `cameras/${camera}/live.jpg`);
    if (!loaded && camera === this.#select.value) setText(element('zone-help'), `There is no picture of ${camera} now.`);
  }

  /** @param {Shape['kind']} kind */
  #create(kind) {
    if (!this.#place) return;
    this.#edit({ zone: '', camera: this.#place.camera, area: kind === 'area' ? [] : null, line: kind === 'line' ? [] : null, inner: null, rules: [] });
    element('zone-name').focus({ preventScroll: true });
  }

  /** @param {SiteZone | undefined} zone */
  #edit(zone) {
    if (!zone || !this.#editable) return;
    if ((zone.camera ?? FLOOR) !== this.#select.value) {
      this.#select.value = zone.camera ?? FLOOR;
      this.#showPlace();
    }
    if (!this.#place) return;
    this.#selected = zone;
    this.#openedDigest = this.#digest;
    const shape = shapeOf(zone);
    this.#form.open(zone, shape, this.#place, this.#ruleNames(zone));
    setText(element('zone-help'), HELP[shape.kind]);
    setText(this.#state, '');
    this.#showList();
    this.#draw();
  }

  #editSiteRules() {
    this.#deselect('');
    this.#openedDigest = this.#digest;
    this.#openedRules = this.#rules;
    this.#form.openSiteRules(this.#rules, this.#ruleNames(null));
    setText(element('zone-help'), 'These rules apply anywhere on the site.');
  }

  /**
   * @param {SiteZone | null} except null: those on no zone
   * @returns {string[]} names of all other rules
   */
  #ruleNames(except) {
    const rules = this.#zones.flatMap((zone) => (zone === except ? [] : zone.rules));
    return [...rules, ...(except ? this.#rules : [])].map(({ rule }) => rule);
  }

  /** @param {string} message */
  #deselect(message) {
    this.#selected = null;
    this.#form.close();
    setText(element('zone-help'), '');
    setText(this.#state, message);
    this.#showList();
    this.#draw();
  }

  #draw() {
    const place = this.#select.value;
    const others = this.#zones.filter((zone) => (zone.camera ?? FLOOR) === place && zone !== this.#selected);
    this.#stage.draw(others, this.#form.shape);
  }

  #showList() {
    const items = this.#zones.map((zone) => {
      const where = zone.camera === null ? 'floor' : zone.camera;
      const people = this.#people.get(zone.zone) ?? [];
      const button = make('button', { type: 'button', textContent: `${zone.zone}, ${where}`, disabled: !this.#editable });
      button.setAttribute('aria-pressed', String(zone === this.#selected));
      button.addEventListener('click', () => this.#edit(zone));
      const now = zone.area ? people.map((object) => shortLabel(object)).join(', ') || 'no one' : '';
      return make('li', {}, button, make('span', { className: 'quiet', textContent: now }));
    });
    const list = element('zone-list');
    const focused = [...list.querySelectorAll('button')].findIndex((button) => button === document.activeElement);
    list.replaceChildren(...items);
    list.querySelectorAll('button')[focused]?.focus();
  }

  /** Show who is in the zones and where people are on the floor. */
  async #refresh() {
    /** @type {Rules} */
    const { zones } = await getJson('api/rules');
    this.#people = new Map(zones.map(({ zone, objects }) => [zone, objects]));
    this.#showList();
    const place = this.#place;
    if (place?.camera === null) this.#stage.drawPeople(this.plan.tracks.flatMap((track) => drawTrack(track, place.size)));
  }

  /** @param {SiteZone} zone */
  async #save(zone) {
    await this.#change('PUT', { ...zone, replaces: this.#selected?.zone || null });
  }

  async #remove() {
    await this.#change('DELETE', { zone: this.#selected?.zone });
  }

  /**
   * @param {'PUT' | 'DELETE'} method
   * @param {object} content
   */
  async #change(method, content) {
    try {
      const answer = await requestOperator('zones', method, { ...content, digest: this.#openedDigest });
      this.#deselect('Saved; the earlier file is kept beside it.');
      this.#take(answer);
      this.#draw();
      await this.#awaitApplied(answer);
    } catch (error) {
      const message = error instanceof Error ? error.message : '';
      setText(this.#state, this.#form.showRefusal(message) ? '' : message);
      await this.#resolve(method, content);
    }
  }

  /**
   * After a refusal, see what others have changed: other zones are no obstacle; the same one is kept as it is drawn here.
   *
   * @param {'PUT' | 'DELETE'} method
   * @param {object} content
   */
  async #resolve(method, content) {
    /** @type {SiteZones | null} */
    const now = (await requestOperator('zones').catch(this.showError)) ?? null;
    if (!now || now.unavailable || now.digest === this.#openedDigest) return now && this.#take(now);
    const [opened, name] = [this.#selected, this.#selected?.zone];
    const theirs = now.zones.find(({ zone }) => zone === name);
    const isSame = opened ? !name || isEqual(theirs, opened) : isEqual(now.rules, this.#openedRules);
    if (opened && name) this.#selected = theirs ?? { ...opened, zone: '' };
    this.#button('zone-remove').hidden = !this.#selected?.zone;
    this.#openedDigest = now.digest;
    this.#openedRules = now.rules;
    this.#take(now);
    this.#draw();
    if (isSame) return await this.#change(method, content);
    const what = !opened ? 'changed these rules' : theirs ? `changed zone ${name}` : `removed zone ${name}`;
    setText(this.#state, `Somebody else has ${what} meanwhile. What is entered here is kept: save it, or cancel to see theirs.`);
  }

  /** @param {SiteZones} zones in the file */
  async #awaitApplied({ in_force: inForce }) {
    for (let tries = 0; !inForce && tries < APPLIED_TRIES; tries += 1) {
      await pause(APPLIED_EVERY_MS);
      inForce = (await requestOperator('zones')).in_force;
    }
    if (!this.#selected) setText(this.#state, inForce ? 'Saved, and in force; the earlier file is kept.' : 'Saved; not in force yet.');
    await this.fileChanged();
  }

  /**
   * @param {string} id
   * @returns {HTMLButtonElement}
   */
  #button(id) {
    return element(id);
  }
}

/**
 * @param {unknown} one
 * @param {unknown} other
 */
function isEqual(one, other) {
  return JSON.stringify(one) === JSON.stringify(other);
}
