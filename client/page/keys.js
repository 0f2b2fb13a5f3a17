/** The keyboard: left and right walk through the people, B shows or hides boxes, M is sound, F fills the screen. */

/**
 * @param {object} act
 * @param {(by: number) => void} act.step to the next or previous person
 * @param {() => void} act.boxes
 * @param {() => void} act.sound
 * @param {() => void} act.fullScreen
 */
export function listenToKeys(act) {
  /** @type {Record<string, () => void>} */
  const keys = {
    ArrowRight: () => act.step(1),
    ArrowLeft: () => act.step(-1),
    b: act.boxes,
    m: act.sound,
    f: act.fullScreen,
  };
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const action = keys[name];
    if (!action) return;
    event.preventDefault();
    action();
  });
}
