/** The view in the page's address, so that it can be shared as a link and the browser's back button works. */

/**
 * @typedef {object} AddressView
 * @property {number | null} object the selected person
 * @property {string | null} camera the held camera
 * @property {string | null} prefer the preferred camera
 * @property {number[]} beside people on small tiles
 * @property {string | null} delay live or smooth; null: balanced
 */

const NUMBER = /^\d{1,9}$/;
const DELAYS = ['live', 'smooth'];

/** @returns {AddressView} */
export function readAddress() {
  const query = new URLSearchParams(location.search);
  const object = query.get('object') ?? '';
  const beside = (query.get('beside') ?? '').split(',').filter((text) => NUMBER.test(text));
  return {
    object: NUMBER.test(object) ? Number(object) : null,
    camera: query.get('camera'),
    prefer: query.get('prefer'),
    beside: [...new Set(beside.map(Number))],
    delay: DELAYS.find((delay) => delay === query.get('delay')) ?? null,
  };
}

/**
 * @param {AddressView} view
 * @param {boolean} addStep whether to add a step to the browser's history
 */
export function writeAddress({ object, camera, prefer, beside, delay }, addStep) {
  if (JSON.stringify(readAddress()) === JSON.stringify({ object, camera, prefer, beside, delay })) return;
  const address = new URL(location.href);
  address.searchParams.set('object', String(object));
  for (const [name, value] of Object.entries({ camera, prefer, beside: beside.join() || null, delay })) {
    if (value === null) address.searchParams.delete(name);
    else address.searchParams.set(name, value);
  }
  if (addStep) history.pushState(null, '', address);
  else history.replaceState(null, '', address);
}

/** @param {(view: AddressView) => void} changed called after a step through the browser's history */
export function onAddressChange(changed) {
  window.addEventListener('popstate', () => changed(readAddress()));
}
