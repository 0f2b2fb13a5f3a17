/** JSON requests with timeouts. Addresses are relative to the page, for reverse proxies. */

import { Backoff } from './backoff.js';

const TIMEOUT_MS = 4000;
const OPERATOR_TIMEOUT_MS = 8000;

/** An HTTP answer with an error status. */
export class HttpError extends Error {
  /**
   * @param {string} message
   * @param {number} status
   */
  constructor(message, status) {
    super(message);
    this.status = status;
  }

  /** @returns {boolean} whether a retry would fail as well */
  get permanent() {
    return this.status >= 400 && this.status < 500;
  }
}

/**
 * @param {string} path relative to the page, such as api/site
 * @returns {Promise<any>}
 * @throws {Error} when the server is unreachable, too slow, or answers with an error
 */
export async function getJson(path) {
  const response = await fetch(path, { cache: 'no-store', signal: AbortSignal.timeout(TIMEOUT_MS) });
  if (!response.ok) throw new HttpError(`${path}: ${response.status}`, response.status);
  return response.json();
}

/**
 * @param {string} name below api/operator/
 * @param {'GET' | 'POST' | 'PUT' | 'DELETE'} [method]
 * @param {object} [content] the request's JSON
 * @param {number} [timeoutMs]
 * @returns {Promise<any>}
 * @throws {HttpError} with the server's error message
 * @throws {Error} the server does not answer
 */
export function requestOperator(name, method = 'GET', content, timeoutMs = OPERATOR_TIMEOUT_MS) {
  return requestJson(`api/operator/${name}`, method, content, timeoutMs);
}

/** @typedef {(wait: string) => void} ShowWait receives what a trial waits for; empty: it runs */

/**
 * Start a trial of a camera and wait for its result, which may come after those of others.
 *
 * @param {string} name below api/operator/
 * @param {object} content the request's JSON
 * @param {ShowWait} showWait
 * @param {(trial: number) => void} [begun] receives the key of a trial that is not over at once
 * @returns {Promise<any>}
 * @throws {HttpError} with the server's error message
 * @throws {Error} the server does not answer the first request
 */
export async function requestTrial(name, content, showWait, begun) {
  const answer = await requestOperator(name, 'POST', content);
  if (answer.ahead !== undefined) begun?.(answer.trial);
  return followTrial(answer, showWait);
}

/**
 * Wait for the result of a trial, after a first answer to it.
 *
 * @param {any} answer
 * @param {ShowWait} showWait
 * @returns {Promise<any>}
 * @throws {HttpError} with the server's error message
 */
export async function followTrial(answer, showWait) {
  while (answer.ahead !== undefined) {
    const { trial, ahead } = answer;
    showWait(ahead ? `waiting for ${ahead} ${ahead > 1 ? 'trials' : 'trial'} before…` : '');
    answer = await untilAnswered(() => requestOperator(`setup/trials/${trial}`), () => showWait('the server does not answer; asking again…'));
  }
  return answer;
}

/**
 * Request an address whose errors are one line of text for the user.
 *
 * @param {string} path relative to the page
 * @param {'GET' | 'POST' | 'PUT' | 'DELETE'} [method]
 * @param {object} [content] the request's JSON
 * @param {number} [timeoutMs]
 * @returns {Promise<any>}
 * @throws {HttpError} with the server's error message
 * @throws {Error} the server does not answer
 */
export async function requestJson(path, method = 'GET', content, timeoutMs = OPERATOR_TIMEOUT_MS) {
  const response = await send(path, method, content, timeoutMs);
  const answer = await response.json().catch(() => ({}));
  if (!response.ok) throw new HttpError(answer.error ?? `The server answers ${response.status}.`, response.status);
  return answer;
}

/**
 * @param {string} path
 * @param {string} method
 * @param {object | undefined} content
 * @param {number} timeoutMs
 */
async function send(path, method, content, timeoutMs) {
  try {
    return await fetch(path, {
      method,
      cache: 'no-store',
      headers: method === 'GET' ? {} : { 'X-MyView-Changes': '1', 'Content-Type': 'application/json' },
      body: content && JSON.stringify(content),
      signal: AbortSignal.timeout(timeoutMs),
    });
  } catch {
    throw new Error('The server does not answer.');
  }
}

/**
 * Repeat a request until the server answers, even if with a permanent error.
 *
 * @template T
 * @param {() => Promise<T>} request
 * @param {(error: unknown) => void} showError receives why it failed so far
 * @returns {Promise<T>}
 * @throws {HttpError} a permanent one
 */
export async function untilAnswered(request, showError) {
  const backoff = new Backoff();
  for (;;) {
    try {
      return await request();
    } catch (error) {
      if (error instanceof HttpError && error.permanent) throw error;
      showError(error);
      await pause(backoff.next());
    }
  }
}

/**
 * Make an address of the server relative to the page, which may be served below a path by a reverse proxy.
 *
 * @param {string} address that starts at the server's root
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
