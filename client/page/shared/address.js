/** Who is watched, and by which camera, in the page's address: the link to share, and the browser's back button. */

/**
 * @typedef {object} Watched
 * @property {number | null} object
 * @property {string | null} camera held by hand; null: none is
 * @property {string | null} prefer the camera that is preferred; null: none is
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
    prefer: query.get('prefer'),
    beside: [...new Set(beside.map(Number))],
  };
}

/**
 * @param {Watched} watched
 * @param {boolean} chosen by the viewer (a step to go back from) or by default
 */
export function writeAddress(watched, chosen) {
  const { object, camera, prefer, beside } = watched;
  if (JSON.stringify(watchedInAddress()) === JSON.stringify({ object, camera, prefer, beside })) return;
  const address = new URL(location.href);
  address.searchParams.set('object', String(object));
  for (const [name, value] of Object.entries({ camera, prefer, beside: beside.join() || null })) {
    if (value === null) address.searchParams.delete(name);
    else address.searchParams.set(name, value);
  }
  if (chosen) history.pushState(null, '', address);
  else history.replaceState(null, '', address);
}

/** @param {(watched: Watched) => void} tell */
export function onAddress(tell) {
  window.addEventListener('popstate', () => tell(watchedInAddress()));
}
