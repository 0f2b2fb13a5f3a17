/** Puts the operator's page together: who may see it, and which of its sections is open. */

import { getJson } from './http.js';
import { ask, Refused } from './operator_http.js';

const SIGN_IN_CODES = [401, 429];

/**
 * @template {HTMLElement} T
 * @param {string} id
 * @returns {T}
 */
function element(id) {
  return /** @type {T} */ (document.getElementById(id));
}

/** @type {HTMLFormElement} */
const form = element('sign-in');
/** @type {HTMLInputElement} */
const token = element('token');

/** @param {unknown} error what went wrong; null: nothing */
function tell(error) {
  const line = error instanceof Error ? error.message : '';
  const trouble = element('trouble');
  if (trouble.textContent !== line) trouble.textContent = line; // or it is read out again
  if (error instanceof Refused && error.status === 401) form.hidden = false;
}

async function open() {
  try {
    const session = await ask('session');
    form.hidden = true;
    element('sign-out').hidden = !session.by_token;
    tell(null);
  } catch (error) {
    form.hidden = !(error instanceof Refused && SIGN_IN_CODES.includes(error.status));
    tell(form.hidden ? error : null); // the form says it already
    if (!form.hidden) token.focus();
  }
}

form.addEventListener('submit', async (event) => {
  event.preventDefault();
  try {
    await ask('session', 'POST', { token: token.value });
    token.value = '';
    await open();
  } catch (error) {
    tell(error);
    token.select();
  }
});

element('sign-out').addEventListener('click', async () => {
  await ask('session', 'DELETE').catch(tell);
  location.reload(); // nothing that was shown stays
});

void getJson('api/site').then((site) => (element('site').textContent = site.name), tell);
void open();
