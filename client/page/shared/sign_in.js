/** Signing in and out, on both pages: exchanges a token for a cookie that scripts cannot read. */

import { element } from './dom.js';
import { HttpError, requestJson, untilAnswered } from './requests.js';

/** @import {Session} from './api_types.js' */

const SESSION = 'api/session';
const NEEDS_TOKEN = [401, 403, 429]; // no token, an invalid one, too many attempts
const TOKEN_IN_LINK = /^#token=([\w-]+)$/;

/**
 * Exchange the token in the page's address, if there is one, and remove it from there. As a fragment it is sent to
 * no server and appears in no log.
 *
 * @param {(error: unknown) => void} showError receives why the server has not answered so far
 * @throws {HttpError} the token is not valid
 */
export async function exchangeTokenInLink(showError) {
  const [, token] = TOKEN_IN_LINK.exec(location.hash) ?? [];
  if (!token) return;
  history.replaceState(null, '', location.pathname + location.search);
  await untilAnswered(() => exchange(token), showError);
}

/** @param {string} token */
function exchange(token) {
  return requestJson(SESSION, 'POST', { token });
}

export class SignIn {
  /** @type {HTMLFormElement} */
  #form = element('sign-in');
  /** @type {HTMLInputElement} */
  #field = element('token');
  #signOut = element('sign-out');

  /**
   * @param {() => void} signedIn
   * @param {(error: unknown) => void} showError null: no error
   */
  constructor(signedIn, showError) {
    this.showError = showError;
    this.#form.addEventListener('submit', async (event) => {
      event.preventDefault();
      if (await this.#signIn(this.#field.value)) {
        this.#field.value = '';
        signedIn();
      } else this.#field.select();
    });
    this.#signOut.addEventListener('click', async () => {
      await requestJson(SESSION, 'DELETE').catch(showError);
      location.reload(); // removes everything that was shown
    });
  }

  /** Sign in with the token in the page's address, if there is one. */
  async signInByLink() {
    await exchangeTokenInLink(this.showError).then(() => this.showError(null), this.showError);
  }

  /**
   * @returns {Promise<Session | null>} the visitor's rights; null: sign-in is needed, and the form is shown
   * @throws {Error} the server does not answer
   */
  async getSession() {
    try {
      const session = await requestJson(SESSION);
      this.#form.hidden = true;
      this.#signOut.hidden = !session.by_token;
      return session;
    } catch (error) {
      if (!(error instanceof HttpError) || !NEEDS_TOKEN.includes(error.status)) throw error;
      if (error.status === 403) this.showError(error);
      this.showForm();
      return null;
    }
  }

  showForm() {
    if (!this.#form.hidden) return;
    this.#form.hidden = false;
    this.#field.focus();
  }

  /** @param {string} token */
  async #signIn(token) {
    try {
      await exchange(token);
      this.#form.hidden = true;
      this.showError(null);
      return true;
    } catch (error) {
      this.showError(error);
      return false;
    }
  }
}
