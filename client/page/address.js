/** The chosen person in the page's address: the link to share, and the browser's back button. */

/** @returns {number | null} */
export function objectInAddress() {
  const text = new URLSearchParams(location.search).get('object') ?? '';
  return /^\d{1,9}$/.test(text) ? Number(text) : null;
}

/**
 * @param {number} object
 * @param {boolean} chosen by the viewer (a step to go back from) or by default
 */
export function writeAddress(object, chosen) {
  if (objectInAddress() === object) return;
  const address = new URL(location.href);
  address.searchParams.set('object', String(object));
  if (chosen) history.pushState(null, '', address);
  else history.replaceState(null, '', address);
}

/** @param {(object: number | null) => void} tell */
export function onAddress(tell) {
  window.addEventListener('popstate', () => tell(objectInAddress()));
}
