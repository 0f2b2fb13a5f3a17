/** Keyboard shortcuts. Each is the aria-keyshortcuts of the button with the same action. */

const PRESS_KEYS = new Set([' ', 'Enter']); // activate a focused button
const SCROLL_KEYS = new Set(['ArrowLeft', 'ArrowRight']); // scroll a focused region

/** @param {Record<string, () => void>} actions by KeyboardEvent.key, single letters in lower case */
export function listenToKeys(actions) {
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || isIn(event.target, 'select, form')) return;
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const action = actions[name];
    if (!action || (PRESS_KEYS.has(event.key) && isIn(event.target, 'button, summary, a'))) return;
    if (SCROLL_KEYS.has(event.key) && isIn(event.target, '[role=region]')) return;
    event.preventDefault();
    action();
  });
}

/**
 * @param {EventTarget | null} target
 * @param {string} selector
 */
function isIn(target, selector) {
  return target instanceof Element && target.closest(selector) !== null;
}
