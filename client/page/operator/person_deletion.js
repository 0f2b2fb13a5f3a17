/** Deletion of a person's data: what would be deleted, then the confirmation. */

import { requestOperator } from '../shared/requests.js';
import { element, setLines, setText } from '../shared/dom.js';

/** @import {PersonDeletionPlan} from './api_types.js' */
/** @import {ShowError} from './section.js' */

const TIMEOUT_MS = 90000; // longer than the server waits for its disk

export class PersonDeletion {
  /** @type {HTMLInputElement} */
  #number = element('delete-object');
  /** @type {HTMLFormElement} */
  #confirmation = element('delete-confirmation');
  /** @type {HTMLButtonElement} */
  #button = element('delete-now');
  #state = element('delete-state');
  /** What is shown is of this person. */
  #object = 0;
  /** Raised with each plan, and when one is closed: what is answered to earlier requests is not shown. */
  #newest = 0;

  /** @param {ShowError} showError */
  constructor(showError) {
    this.showError = showError;
    element('delete-form').addEventListener('submit', (event) => {
      event.preventDefault();
      void this.#plan();
    });
    this.#number.addEventListener('input', () => this.#close());
    element('delete-cancel').addEventListener('click', () => this.#close());
    this.#confirmation.addEventListener('submit', (event) => {
      event.preventDefault();
      void this.#delete();
    });
  }

  #close() {
    this.#newest += 1;
    this.#confirmation.hidden = true;
    setText(this.#state, '');
  }

  async #plan() {
    this.#close();
    const request = this.#newest;
    try {
      /** @type {PersonDeletionPlan} */
      const plan = await requestOperator(`deletion?object=${Number(this.#number.value)}`, 'GET', undefined, TIMEOUT_MS);
      if (request !== this.#newest) return;
      this.#object = plan.object;
      setLines(element('delete-plan'), describe(plan));
      setText(element('delete-losses'), describeLosses(plan));
      this.#confirmation.reset();
      this.#confirmation.hidden = false;
      this.#button.disabled = false;
      this.showError(null);
    } catch (error) {
      if (request === this.#newest) this.showError(error);
    }
  }

  async #delete() {
    const object = this.#object;
    const request = this.#newest;
    const recordings = new FormData(this.#confirmation).get('recordings');
    this.#button.disabled = true;
    setText(this.#state, 'Deleting…');
    try {
      /** @type {PersonDeletionPlan} */
      const { state } = await requestOperator('deletion', 'POST', { object, recordings }, TIMEOUT_MS);
      if (request === this.#newest) {
        this.#close();
        this.#number.value = '';
      }
      setText(this.#state, state === 'done' ? `The data of person ${object} are deleted.` : 'The deletion goes on.');
      this.showError(null);
    } catch (error) {
      if (request === this.#newest) this.#close();
      this.showError(error);
    }
  }
}

/** @param {PersonDeletionPlan} plan */
function describe({ objects, name, visible, events, decisions, seen_s: seen, mentions }) {
  const numbers = `${name ? `${name}: ` : ''}${objects.length > 1 ? 'numbers' : 'number'} ${objects.join(', ')}, looks, pictures, ${count(events, 'event')}`;
  const lines = [numbers, `${count(decisions, 'recorded group')} of frames without their rows: ${duration(seen)} in view`];
  if (visible) lines.push('In view now: goes on as a new person, with another number.');
  return [...lines, ...mentions.map((text) => `Not deleted: ${text}.`)];
}

/** @param {PersonDeletionPlan} plan */
function describeLosses({ cameras, sound_s: sound, others }) {
  const lost = cameras.map(({ camera, deleted_s: seconds }) => `${camera} ${duration(seconds)}`);
  if (sound) lost.push(`sound ${duration(sound)}`);
  const shorter = others.map(({ object, name, deleted_s: seconds }) => `${name ?? `person ${object}`} ${duration(seconds)}`);
  if (!lost.length) return 'nothing is recorded';
  return lost.join(', ') + (shorter.length ? `; the best views of others lose: ${shorter.join(', ')}` : '');
}

/**
 * @param {number} number
 * @param {string} what
 */
function count(number, what) {
  return `${number} ${what}${number === 1 ? '' : 's'}`;
}

/** @param {number} seconds */
function duration(seconds) {
  const whole = Math.round(seconds);
  return whole < 60 ? `${whole} s` : `${Math.floor(whole / 60)} min ${whole % 60} s`;
}
