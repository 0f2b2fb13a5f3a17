/** The keyboard. What a key does stands beside the button that does the same, as its aria-keyshortcuts. */

const PRESSES = new Set([' ', 'Enter']); // what has the focus, if it can be pressed
const SCROLLS = new Set(['ArrowLeft', 'ArrowRight']); // what has the focus, if it can be scrolled

/** @param {Record<string, () => void>} keys what each does, by KeyboardEvent.key in lower case */
export function listenToKeys(keys) {
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || isIn(event.target, 'select, form')) return;
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const action = keys[name];
    if (!action || (PRESSES.has(event.key) && isIn(event.target, 'button, summary, a'))) return;
    if (SCROLLS.has(event.key) && isIn(event.target, '[role=region]')) return;
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
