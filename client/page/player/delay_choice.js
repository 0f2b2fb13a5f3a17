/** The choice of delay: what is known of what follows when a view is selected, each with its measured cost. */

import { make } from '../shared/dom.js';

/** @import {ViewerDelay} from '../shared/api_types.js' */

export const BALANCED = 'balanced';
const NAMES = /** @type {Record<string, string>} */ ({ live: 'Live', balanced: 'Balanced', smooth: 'Smooth' });
/** Why a view of another delay is shown. */
export const DELAY_REASONS = /** @type {Record<string, string>} */ ({
  live: 'Live: selected by what was known before these pictures.',
  smooth: 'Smooth: selected by seconds of what follows.',
});

/** @param {ViewerDelay} delay */
function label({ delay, delay_s: seconds, regret_s: regret }) {
  const measured = [
    seconds === null ? '' : `${seconds.toFixed(1)} s`,
    regret === null ? '' : `regret ${regret.toFixed(1)} s/min`,
  ].filter(Boolean);
  return [NAMES[delay] ?? delay, ...measured].join(' · ');
}

export class DelayChoice {
  /**
   * @param {HTMLSelectElement} select
   * @param {(delay: string | null) => void} chosen null: balanced
   */
  constructor(select, chosen) {
    this.select = select;
    select.addEventListener('change', () => chosen(select.value === BALANCED ? null : select.value));
  }

  /**
   * @param {ViewerDelay[]} delays that the site offers
   * @param {string | null} chosen null: balanced
   */
  show(delays, chosen) {
    const { select } = this;
    select.hidden = delays.length < 2;
    const known = [...select.options].map((option) => option.value).join();
    if (known !== delays.map(({ delay }) => delay).join()) {
      select.replaceChildren(...delays.map(({ delay }) => make('option', { value: delay })));
    }
    delays.forEach((delay, place) => {
      const option = select.options[place];
      const text = label(delay);
      if (option && option.textContent !== text) option.textContent = text;
    });
    select.value = chosen ?? BALANCED;
  }
}
