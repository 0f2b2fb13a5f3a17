/** Small JSON requests that give up in time. Addresses are relative to the page, for reverse proxies. */

const PATIENCE_MS = 4000;

/**
 * @param {string} path relative to the page, such as api/site
 * @param {number} [patience] milliseconds until the request is given up
 * @returns {Promise<any>}
 * @throws {Error} when the server is away, too slow, or answers with an error
 */
export async function getJson(path, patience = PATIENCE_MS) {
  const response = await fetch(path, { cache: 'no-store', signal: AbortSignal.timeout(patience) });
  if (!response.ok) throw new Refused(path, response.status);
  return response.json();
}

/** An answer that is an error. */
export class Refused extends Error {
  /**
   * @param {string} path
   * @param {number} status
   */
  constructor(path, status) {
    super(`${path}: ${status}`);
    this.status = status;
  }

  /** @returns {boolean} whether to ask again would not help: what was asked for is not there */
  get forGood() {
    return this.status >= 400 && this.status < 500;
  }
}

/**
 * The server's own addresses start at its root; behind a proxy the page may live deeper.
 *
 * @param {string} address
 */
export function relative(address) {
  return address.replace(/^\/+/, '');
}

/**
 * @param {number} milliseconds
 * @param {AbortSignal} [signal] ends the wait early, without an error
 * @returns {Promise<void>}
 */
export function pause(milliseconds, signal) {
  return new Promise((resolve) => {
    if (signal?.aborted) return resolve();
    const done = () => {
      clearTimeout(timer);
      signal?.removeEventListener('abort', done);
      resolve();
    };
    const timer = setTimeout(done, milliseconds);
    signal?.addEventListener('abort', done);
  });
}
