/** Who is watched, and by which camera, in the page's address: the link to share, and the browser's back button. */

/**
 * @typedef {object} Watched
 * @property {number | null} object
 * @property {string | null} camera held by hand; null: whichever sees them best
 */

/** @returns {Watched} */
export function watchedInAddress() {
  const query = new URLSearchParams(location.search);
  const text = query.get('object') ?? '';
  return { object: /^\d{1,9}$/.test(text) ? Number(text) : null, camera: query.get('camera') };
}

/**
 * @param {Watched} watched
 * @param {boolean} chosen by the viewer (a step to go back from) or by default
 */
export function writeAddress({ object, camera }, chosen) {
  const old = watchedInAddress();
  if (old.object === object && old.camera === camera) return;
  const address = new URL(location.href);
  address.searchParams.set('object', String(object));
  if (camera === null) address.searchParams.delete('camera');
  else address.searchParams.set('camera', camera);
  if (chosen) history.pushState(null, '', address);
  else history.replaceState(null, '', address);
}

/** @param {(watched: Watched) => void} tell */
export function onAddress(tell) {
  window.addEventListener('popstate', () => tell(watchedInAddress()));
}
