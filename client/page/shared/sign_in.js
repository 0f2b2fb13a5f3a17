/** Signing in and out, on both pages: a token for a cookie, which no script can read. */

import { element } from './element.js';
import { askAt, Refused } from '../operator/requests.js';

/** @import {Session} from './contract.js' */

const SESSION = 'api/session';
const NEEDS_TOKEN = [401, 403, 429]; // none, one that is void, too many wrong ones
const IN_LINK = /^#token=([\w-]+)$/;

export class SignIn {
  /** @type {HTMLFormElement} */
  #form = element('sign-in');
  /** @type {HTMLInputElement} */
  #field = element('token');
  #out = element('sign-out');

  /**
   * @param {() => void} done what to do when somebody has signed in
   * @param {(error: unknown) => void} tell says what went wrong; null: nothing
   */
  constructor(done, tell) {
    this.tell = tell;
    this.#form.addEventListener('submit', async (event) => {
      event.preventDefault();
      if (await this.#signIn(this.#field.value)) {
        this.#field.value = '';
        done();
      } else this.#field.select();
    });
    this.#out.addEventListener('click', async () => {
      await askAt(SESSION, 'DELETE').catch(tell);
      location.reload(); // nothing that was shown stays
    });
  }

  /**
   * Signs in by the token in the page's address, if it has one, and takes it out of there: behind a # it is sent
   * to no server, and stands in nobody's log.
   */
  async begin() {
    const [, token] = IN_LINK.exec(location.hash) ?? [];
    if (!token) return;
    history.replaceState(null, '', location.pathname + location.search);
    await this.#signIn(token);
  }

  /**
   * @returns {Promise<Session | null>} what whoever looks at this page may; null: they have to sign in
   * @throws {Error} the server does not say
   */
  async look() {
    try {
      const session = await askAt(SESSION);
      this.#form.hidden = true;
      this.#out.hidden = !session.by_token;
      return session;
    } catch (error) {
      if (!(error instanceof Refused) || !NEEDS_TOKEN.includes(error.status)) throw error;
      if (error.status === 403) this.tell(error);
      this.ask();
      return null;
    }
  }

  /** Shows the form. */
  ask() {
    if (!this.#form.hidden) return;
    this.#form.hidden = false;
    this.#field.focus();
  }

  /** @param {string} token */
  async #signIn(token) {
    try {
      await askAt(SESSION, 'POST', { token });
      this.#form.hidden = true;
      this.tell(null);
      return true;
    } catch (error) {
      this.tell(error);
      return false;
    }
  }
}
