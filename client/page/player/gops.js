/** A GOP may come all at once: whatever waits for frames waits for whole GOPs, too. */

const GOPS = 2; // that may lie ahead, or pass between two that come, whatever the seconds say

/**
 * @param {number} seconds
 * @param {number} gopS seconds of a GOP
 * @returns {number} so many seconds, and no fewer than so many GOPs take
 */
export const atLeast = (seconds, gopS) => Math.max(seconds, GOPS * gopS);
