/** How much of the past the band shows: as much as is kept can be chosen. */

/** @type {[number, string][]} seconds, in words */
const SPANS = [
  [60, 'Last minute'],
  [600, 'Last 10 minutes'],
  [3600, 'Last hour'],
  [21_600, 'Last 6 hours'],
  [86_400, 'Last day'],
  [604_800, 'Last week'],
];

export class Span {
  /**
   * @param {HTMLSelectElement} select
   * @param {HTMLElement} band that it is about
   * @param {() => void} changed
   */
  constructor(select, band, changed) {
    this.select = select;
    select.setAttribute('aria-controls', band.id);
    this.#fill(1);
    select.addEventListener('change', changed);
  }

  /**
   * @param {number} seconds that are kept; not above 0: none, or it is not known
   * @returns {number} seconds that are to be shown
   */
  offer(seconds) {
    const within = SPANS.findIndex(([span]) => seconds <= span);
    this.#fill(seconds > 0 ? (within < 0 ? SPANS.length : within + 1) : 1);
    return Number(this.select.value);
  }

  /** @param {number} count of choices */
  #fill(count) {
    const { select } = this;
    if (select.options.length === count || select === document.activeElement) return; // or it changes under the hand
    const chosen = select.value;
    select.replaceChildren(...SPANS.slice(0, count).map(([seconds, words]) => new Option(words, String(seconds))));
    if (SPANS.slice(0, count).some(([seconds]) => String(seconds) === chosen)) select.value = chosen;
    select.disabled = count < 2;
  }
}
