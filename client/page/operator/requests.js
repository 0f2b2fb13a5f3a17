/** Requests to the operator's addresses, and others that answer as they do: errors are one line for people. */

const PATIENCE_MS = 8000;

export class Refused extends Error {
  /**
   * @param {string} line
   * @param {number} status of HTTP
   */
  constructor(line, status) {
    super(line);
    this.status = status;
  }
}

/**
 * @param {string} what below api/operator/
 * @param {'GET' | 'POST' | 'PUT' | 'DELETE'} [method]
 * @param {object} [content] becomes the request's JSON
 * @returns {Promise<any>}
 * @throws {Refused} the server says no
 * @throws {Error} it says nothing
 */
export function ask(what, method = 'GET', content) {
  return askAt(`api/operator/${what}`, method, content);
}

/**
 * @param {string} path relative to the page
 * @param {'GET' | 'POST' | 'PUT' | 'DELETE'} [method]
 * @param {object} [content] becomes the request's JSON
 * @returns {Promise<any>}
 * @throws {Refused} the server says no
 * @throws {Error} it says nothing
 */
export async function askAt(path, method = 'GET', content) {
  const response = await send(path, method, content);
  const answer = await response.json().catch(() => ({}));
  if (!response.ok) throw new Refused(answer.error ?? `The server answers ${response.status}.`, response.status);
  return answer;
}

/**
 * @param {string} path
 * @param {string} method
 * @param {object} [content]
 */
async function send(path, method, content) {
  try {
    return await fetch(path, {
      method,
      cache: 'no-store',
      headers: method === 'GET' ? {} : { 'X-MyView-Changes': '1', 'Content-Type': 'application/json' },
      body: content && JSON.stringify(content),
      signal: AbortSignal.timeout(PATIENCE_MS),
    });
  } catch {
    throw new Error('The server does not answer.');
  }
}
