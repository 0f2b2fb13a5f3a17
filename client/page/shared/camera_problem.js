/** What is wrong with a camera, and when its source is opened again, in a line. */

/** @import {Camera} from './api_types.js' */

/** @param {Pick<Camera, 'message' | 'retry_at'>} camera */
export function formatCameraProblem({ message, retry_at: retryAt }) {
  return message && retryAt !== null ? `Will be opened again at ${formatMoment(retryAt)}: ${message}` : message;
}

/** @param {number} seconds unix */
export function formatMoment(seconds) {
  const at = new Date(seconds * 1000);
  const day = at.toDateString() === new Date().toDateString() ? '' : `${at.toLocaleDateString()} `;
  return `${day}${at.toLocaleTimeString()}`;
}
