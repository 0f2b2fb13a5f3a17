/** Calibration from places on the floor that are marked in the cameras' pictures. */

import { requestOperator } from '../../shared/requests.js';
import { element, make, setText } from '../../shared/dom.js';
import { MarkedPicture } from '../marking/marked_picture.js';
import { PlaceList } from './place_list.js';
import { PointMarks } from './point_marks.js';
import { ResultView } from './result_view.js';

/** @import {Site} from '../../shared/api_types.js' */
/** @import {MarkedPoints, PointsFile, PointsResult} from '../api_types.js' */
/** @import {Point} from '../marking/camera_pixels.js' */
/** @import {Section, ShowError} from '../section.js' */

const TIMEOUT_MS = 120_000; // drawing the plan takes long on a busy machine
const NEW = ''; // the value of a new place among the places

/** @implements {Section} */
export class CalibrationPoints {
  #marks = new PointMarks();
  #isLoaded = false;
  /** @type {MarkedPoints} */
  #present = { unit: null, points: {}, homographies: {}, digest: '', result: null };
  /** @type {{points: PointsFile, digest: string} | null} what the shown result is of */
  #calibrated = null;
  /** @type {PointsResult['errors'] | null} */
  #errors = null;
  /** @type {Set<number>} */
  #wrong = new Set();
  /** @type {string[]} addresses of the shown result's files */
  #files = [];
  #picture;
  #list;
  #result;
  /** @type {HTMLSelectElement} */
  #next = element('points-next');
  /** @type {HTMLInputElement} */
  #unit = element('points-unit');
  /** @type {HTMLButtonElement} */
  #calibrate = element('points-calibrate');
  /** @type {HTMLButtonElement} */
  #apply = element('points-apply');
  #state = element('points-state');

  /**
   * @param {Site} site
   * @param {ShowError} showError
   * @param {() => Promise<void>} fileChanged called when the result was written into the configuration
   */
  constructor(site, showError, fileChanged) {
    this.site = site;
    this.showError = showError;
    this.fileChanged = fileChanged;
    this.#picture = new MarkedPicture('points', site, {
      mark: (point) => this.#mark(point),
      undo: () => this.#undo(),
      chosen: () => this.#show(),
    });
    this.#list = new PlaceList(this.#marks, () => this.#positionChanged(), () => this.#changed());
    this.#result = new ResultView('points', (text) => setText(this.#state, text));
    element('points-undo').addEventListener('click', () => this.#undo());
    element('points-clear').addEventListener('click', () => {
      this.#marks.clear(this.#picture.camera);
      this.#changed();
    });
    element('points-revert').addEventListener('click', () => void this.#revert());
    element('points-download').addEventListener('click', () => this.#download());
    this.#unit.addEventListener('input', () => this.#positionChanged());
    element('points-form').addEventListener('submit', (event) => {
      event.preventDefault();
      void this.#compute();
    });
    this.#apply.addEventListener('click', () => void this.#write());
  }

  open() {
    void this.#load();
  }

  close() {}

  get #key() {
    return `myview-points:${this.site.name}`;
  }

  async #load() {
    try {
      await Promise.all([this.#picture.open(), this.#loadPresent()]);
    } catch (error) {
      this.showError(error);
    }
    this.#show();
  }

  /** Load the present calibration; its points are shown unless others were marked in this tab. */
  async #loadPresent() {
    if (!this.#isLoaded) this.#restore();
    this.#present = await requestOperator('marked_points');
    if (!this.#isLoaded && !this.#marks.places.length) this.#takePresent();
    this.#isLoaded = true;
  }

  #restore() {
    try {
      const { unit, places } = JSON.parse(sessionStorage.getItem(this.#key) ?? '{"unit": "m", "places": []}');
      this.#unit.value = unit;
      this.#marks.restore(places, this.site.cameras);
    } catch {
      sessionStorage.removeItem(this.#key); // another version of this page wrote it
    }
  }

  #takePresent() {
    this.#unit.value = this.#present.unit ?? 'm';
    this.#marks.load(this.#present.points);
  }

  async #revert() {
    try {
      this.#present = await requestOperator('marked_points');
      this.#takePresent();
      this.#changed();
      sessionStorage.removeItem(this.#key);
    } catch (error) {
      this.showError(error);
    }
  }

  /** @param {Point} point */
  #mark(point) {
    const { camera } = this.#picture;
    const chosen = this.#next.value === NEW ? undefined : this.#marks.places[Number(this.#next.value)];
    const at = chosen ? this.#marks.places.indexOf(chosen) : this.#marks.places.length;
    this.#marks.mark(camera, chosen, point);
    this.#changed();
    if (chosen) {
      const following = this.#marks.places.findIndex(({ seen }, index) => index > at && !seen.has(camera));
      this.#next.value = following < 0 ? NEW : String(following);
    }
    this.#picture.say(chosen ? `Place ${at + 1} is marked in ${camera}.` : `Place ${at + 1}: where is it on the floor?`);
  }

  #undo() {
    this.#marks.undo(this.#picture.camera);
    this.#changed();
  }

  /** Keep the marks for a reload of the page, and discard the result, which is of other ones. */
  #positionChanged() {
    sessionStorage.setItem(this.#key, JSON.stringify({ unit: this.#unit.value, places: this.#marks.save() }));
    this.#wrong.clear();
    this.#showResult(null);
    this.#showChoice();
    this.#list.update(this.#listed);
    setText(this.#state, '');
  }

  get #listed() {
    return { unit: this.#unit.value, homographies: this.#present.homographies, errors: this.#errors, wrong: this.#wrong };
  }

  #changed() {
    this.#positionChanged();
    this.#show();
  }

  #show() {
    this.#showChoice();
    this.#list.show(this.#listed);
    const seen = this.#marks.places.flatMap((place, at) => {
      const point = place.seen.get(this.#picture.camera);
      return point ? [{ point, label: String(at + 1), isWrong: this.#wrong.has(at + 1) }] : [];
    });
    this.#picture.drawPoints(seen);
    setText(element('points-count'), this.#marks.describeMissing(this.#picture.camera));
  }

  /** Offer the places to mark next; the chosen one stays chosen. */
  #showChoice() {
    const { camera } = this.#picture;
    const before = this.#next.value;
    const options = this.#marks.places.map(({ position, seen }, at) => {
      const where = position.every((text) => text.trim()) ? position.join(', ') : 'no position yet';
      return make('option', { value: String(at), textContent: `${at + 1}: ${where}${seen.has(camera) ? ' (marked)' : ''}` });
    });
    this.#next.replaceChildren(make('option', { value: NEW, textContent: 'a new place' }), ...options);
    this.#next.value = Number(before) < this.#marks.places.length ? before : NEW;
  }

  async #compute() {
    const { places } = this.#marks;
    if (!places.some(({ seen }) => seen.size)) return setText(this.#state, 'Mark places on the floor first, at least four in a picture.');
    const file = this.#marks.toFile(this.#unit.value);
    this.#calibrate.disabled = true;
    setText(this.#state, 'Calculating…');
    try {
      /** @type {MarkedPoints} */
      const answer = await requestOperator('marked_points', 'POST', { action: 'calibrate', points: file }, TIMEOUT_MS);
      if (JSON.stringify(file) !== JSON.stringify(this.#marks.toFile(this.#unit.value))) {
        setText(this.#state, 'The marks were changed meanwhile: calibrate again.');
      } else {
        this.#present = answer;
        this.#calibrated = { points: file, digest: answer.digest };
        this.#wrong.clear();
        this.#showResult(answer.result);
        this.#show();
        setText(this.#state, 'Calibrated. The configuration in force is unchanged.');
      }
    } catch (error) {
      this.#showRefusal(error instanceof Error ? error.message : '');
    }
    this.#calibrate.disabled = false;
  }

  /** @param {string} message which may name places that are wrong */
  #showRefusal(message) {
    this.#showResult(null);
    this.#wrong = new Set([...message.matchAll(/\bplace (\d+)/g)].map(([, number]) => Number(number)));
    this.#show();
    setText(this.#state, `Calibration failed: ${message}`);
  }

  /** @param {PointsResult | null} result */
  #showResult(result) {
    for (const address of this.#files) URL.revokeObjectURL(address);
    this.#files = [];
    this.#errors = result?.errors ?? null;
    if (!result) {
      this.#calibrated = null;
      return this.#result.show(null);
    }
    const { lines, configuration } = result;
    const bytes = Uint8Array.from(atob(result.plan), (letter) => letter.charCodeAt(0));
    const plan = bytes.length ? this.#fileOf(bytes, 'image/png') : '';
    this.#result.show({ lines, plan, ground: this.#fileOf(result.ground, 'application/json'), configuration });
  }

  /**
   * @param {BlobPart} content
   * @param {string} type
   * @returns {string} its address, until another result is shown
   */
  #fileOf(content, type) {
    const address = URL.createObjectURL(new Blob([content], { type }));
    this.#files.push(address);
    return address;
  }

  async #write() {
    this.#apply.disabled = true;
    try {
      // The digest of when the result was shown: what another operator has written since is not overwritten.
      this.#present = await requestOperator('marked_points', 'POST', { action: 'apply', ...this.#calibrated });
      sessionStorage.removeItem(this.#key);
      setText(this.#state, 'Written into the configuration; the earlier file is kept beside it.');
      await this.fileChanged();
    } catch (error) {
      setText(this.#state, error instanceof Error ? error.message : '');
    }
    this.#apply.disabled = false;
  }

  #download() {
    const file = `${JSON.stringify(this.#marks.toFile(this.#unit.value), null, 1)}\n`;
    const address = URL.createObjectURL(new Blob([file], { type: 'application/json' }));
    make('a', { href: address, download: 'points.json' }).click();
    setTimeout(() => URL.revokeObjectURL(address), 1000);
  }
}
