/**
 * Splits a live WebM stream (RFC 9559, in EBML, RFC 8794) into whole segments, as mp4.js does with MP4.
 *
 * The Segment element has unknown size and is descended into; each Cluster has a size and holds one frame.
 */

/** @import {Segment} from './mp4.js' */

import { concat } from './mp4.js';

const SEGMENT = 0x18538067;
const TRACKS = 0x1654ae6b;
const CLUSTER = 0x1f43b675;
const TIMESTAMP = 0xe7;
const TICKS = 1000; // per second: the server's WebM has a timestamp scale of one millisecond
const MAX_ELEMENT = 64 * 1024 * 1024; // bytes; a larger size means damaged data

export class ClusterSplitter {
  /** @type {Uint8Array} bytes of an incomplete segment */
  #pending = new Uint8Array(0);

  /**
   * @param {Uint8Array} chunk
   * @returns {Segment[]} the segments that are now complete
   * @throws {Error} when the data is not WebM
   */
  push(chunk) {
    this.#pending = concat([this.#pending, chunk]);
    /** @type {Segment[]} */
    const segments = [];
    let from = 0;
    for (const { id, body, end } of elements(this.#pending)) {
      if (id !== TRACKS && id !== CLUSTER) continue;
      const bytes = this.#pending.slice(from, end);
      segments.push(id === TRACKS ? { kind: 'init', bytes, start: 0 } : { kind: 'media', bytes, start: timestamp(body) });
      from = end;
    }
    this.#pending = this.#pending.slice(from);
    return segments;
  }
}

/**
 * Yield the complete elements at the start of some bytes, in order, descending into the Segment element.
 *
 * @param {Uint8Array} bytes
 */
function* elements(bytes) {
  let at = 0;
  for (;;) {
    const id = readVint(bytes, at, true);
    const size = id && readVint(bytes, at + id.length, false);
    if (!id || !size) return;
    const start = at + id.length + size.length;
    if (id.value === SEGMENT) {
      at = start;
      continue;
    }
    if (size.value > MAX_ELEMENT) throw new Error(`not a WebM element of ${size.value} bytes`);
    const end = start + size.value;
    if (end > bytes.length) return;
    yield { id: id.value, body: bytes.subarray(start, end), end };
    at = end;
  }
}

/**
 * Parse a variable-size integer (RFC 8794, section 4).
 *
 * @param {Uint8Array} bytes
 * @param {number} at
 * @param {boolean} keepMarker whether the marker bit is part of the value, as in element ids
 */
function readVint(bytes, at, keepMarker) {
  if (at >= bytes.length) return null;
  const length = Math.clz32(bytes[at]) - 23;
  if (length > 8) throw new Error('not a WebM integer');
  if (at + length > bytes.length) return null;
  let value = keepMarker ? bytes[at] : bytes[at] & ((1 << (8 - length)) - 1);
  for (let i = 1; i < length; i += 1) value = value * 256 + bytes[at + i];
  return { value, length };
}

/**
 * @param {Uint8Array} cluster
 * @returns {number} seconds
 */
function timestamp(cluster) {
  for (const { id, body } of elements(cluster)) {
    if (id === TIMESTAMP) return body.reduce((value, byte) => value * 256 + byte, 0) / TICKS;
  }
  throw new Error('a WebM cluster without a timestamp');
}
