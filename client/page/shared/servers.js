/**
 * The services of the site that replace each other.
 *
 * All addresses are relative to the document. When the service they lead to is gone, the document's base becomes
 * another one: every later request goes there, and the page's own address stays.
 */

const SILENT_S = 1; // a service that can be replaced and sends nothing for so long, and for
const SILENT_GOPS = 2.5; // so many GOPs, counts as gone

/** @type {string[]} */
let bases = [];
let gopS = 0;
/** @type {Set<() => void>} */
const listeners = new Set();

/**
 * @param {string[]} others base URLs of the services that replace the present one
 * @param {number} seconds of a GOP
 */
export function setServers(others, seconds) {
  bases = [...new Set([...bases, new URL('.', document.baseURI).href, ...others])];
  gopS = seconds;
}

/**
 * @param {number} seconds otherwise
 * @returns {number} seconds of silence after which a service counts as gone
 */
export function silenceS(seconds) {
  return bases.length > 1 ? Math.max(SILENT_S, SILENT_GOPS * gopS) : seconds;
}

/** @returns {string} the service that requests go to now */
export function currentServer() {
  return document.baseURI;
}

/**
 * Go on with another service, unless that has happened since a request was sent.
 *
 * @param {string} server to which the failed request went
 * @returns {boolean} whether the next request goes to another one
 */
export function leaveServer(server) {
  if (bases.length < 2) return false;
  if (server !== currentServer()) return true;
  const place = bases.indexOf(new URL('.', server).href);
  const base = document.querySelector('base') ?? document.head.appendChild(document.createElement('base'));
  base.href = bases[(place + 1) % bases.length];
  for (const listener of listeners) listener();
  return true;
}

/** @param {() => void} listener called when another service is used */
export function onServerChange(listener) {
  listeners.add(listener);
}
