/** Settings of the configuration file that wait for a restart, and the restart of the site. */

import { requestOperator } from '../shared/requests.js';
import { element, setText } from '../shared/dom.js';

/** @import {RestartStatus} from './api_types.js' */
/** @import {ShowError} from './section.js' */

export class SiteRestart {
  /** @type {HTMLButtonElement} */
  #button = element('restart-now');
  #state = element('restart-state');

  /** @param {ShowError} showError */
  constructor(showError) {
    this.showError = showError;
    this.#button.addEventListener('click', () => void this.#restart());
  }

  /** Show what waits for a restart, if anything does. */
  async check() {
    try {
      /** @type {RestartStatus} */
      const { possible, error, changed_keys: keys, refused } = await requestOperator('restart');
      element('restart').hidden = !keys.length || error !== '';
      this.#button.hidden = !possible;
      this.#button.disabled = false;
      const how = possible ? 'Streams end for some seconds when the site restarts.' : 'Restart its processes where they were started.';
      const back = refused && `The last restart went back to the earlier configuration: ${refused}. `;
      setText(this.#state, `${back}Changed in the file, not in force: ${summarize(keys)}. ${how}`);
    } catch (error) {
      this.showError(error);
    }
  }

  async #restart() {
    this.#button.disabled = true;
    try {
      await requestOperator('restart', 'POST');
      setText(this.#state, 'The site restarts…');
    } catch (error) {
      this.#button.disabled = false;
      this.showError(error);
    }
  }
}

/** @param {string[]} keys */
function summarize(keys) {
  const most = 4;
  return keys.length > most ? `${keys.slice(0, most).join(', ')} and ${keys.length - most} more` : keys.join(', ');
}
