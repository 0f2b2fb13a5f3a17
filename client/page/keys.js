/** The keyboard. What a key does stands beside the button that does the same, as its aria-keyshortcuts. */

const PRESSES = new Set([' ', 'Enter']); // what has the focus, if it can be pressed

/** @param {Record<string, () => void>} keys what each does, by KeyboardEvent.key in lower case */
export function listenToKeys(keys) {
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target instanceof HTMLSelectElement) return;
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const action = keys[name];
    if (!action || (PRESSES.has(event.key) && isButton(event.target))) return;
    event.preventDefault();
    action();
  });
}

/** @param {EventTarget | null} target */
function isButton(target) {
  return target instanceof Element && target.closest('button, summary, a') !== null;
}
