/** Who is watched, and by which camera, in the page's address: the link to share, and the browser's back button. */

/**
 * @typedef {object} Watched
 * @property {number | null} object
 * @property {string | null} camera held by hand; null: whichever sees them best
 * @property {number[]} beside who else is seen
 */

const NUMBER = /^\d{1,9}$/;

/** @returns {Watched} */
export function watchedInAddress() {
  const query = new URLSearchParams(location.search);
  const text = query.get('object') ?? '';
  const beside = (query.get('beside') ?? '').split(',').filter((it) => NUMBER.test(it));
  return {
    object: NUMBER.test(text) ? Number(text) : null,
    camera: query.get('camera'),
    beside: [...new Set(beside.map(Number))],
  };
}

/**
 * @param {Watched} watched
 * @param {boolean} chosen by the viewer (a step to go back from) or by default
 */
export function writeAddress({ object, camera, beside }, chosen) {
  const old = watchedInAddress();
  if (old.object === object && old.camera === camera && old.beside.join() === beside.join()) return;
  const address = new URL(location.href);
  address.searchParams.set('object', String(object));
  if (camera === null) address.searchParams.delete('camera');
  else address.searchParams.set('camera', camera);
  if (beside.length) address.searchParams.set('beside', beside.join());
  else address.searchParams.delete('beside');
  if (chosen) history.pushState(null, '', address);
  else history.replaceState(null, '', address);
}

/** @param {(watched: Watched) => void} tell */
export function onAddress(tell) {
  window.addEventListener('popstate', () => tell(watchedInAddress()));
}
