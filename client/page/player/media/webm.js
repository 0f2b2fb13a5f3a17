/**
 * Cuts a live WebM (RFC 9559, in EBML, RFC 8794) into whole segments, as mp4.js does with MP4.
 *
 * The segment element has no end, and is entered; each cluster holds one picture, and says how long it is.
 */

/** @import {Segment} from './mp4.js' */

import { join } from './mp4.js';

const SEGMENT = 0x18538067;
const TRACKS = 0x1654ae6b;
const CLUSTER = 0x1f43b675;
const TIMESTAMP = 0xe7;
const TICKS = 1000; // a second: the server's WebM counts in milliseconds
const LARGEST_ELEMENT = 64 * 1024 * 1024; // bytes; beyond any picture: such a size is damage, not video

export class ClusterSplitter {
  /** @type {Uint8Array} bytes of a segment that is not whole yet */
  #rest = new Uint8Array(0);

  /**
   * @param {Uint8Array} chunk
   * @returns {Segment[]} what has become whole
   * @throws {Error} when the bytes are no WebM
   */
  push(chunk) {
    this.#rest = join([this.#rest, chunk]);
    /** @type {Segment[]} */
    const segments = [];
    let from = 0;
    for (const { id, body, end } of elements(this.#rest)) {
      if (id !== TRACKS && id !== CLUSTER) continue;
      const bytes = this.#rest.slice(from, end);
      segments.push(id === TRACKS ? { kind: 'init', bytes, start: 0 } : { kind: 'media', bytes, start: time(body) });
      from = end;
    }
    this.#rest = this.#rest.slice(from);
    return segments;
  }
}

/**
 * The whole elements at the start of some bytes, in order; those inside the segment, instead of it.
 *
 * @param {Uint8Array} bytes
 */
function* elements(bytes) {
  let at = 0;
  for (;;) {
    const id = number(bytes, at, true);
    const size = id && number(bytes, at + id.length, false);
    if (!id || !size) return;
    const start = at + id.length + size.length;
    if (id.value === SEGMENT) {
      at = start;
      continue;
    }
    if (size.value > LARGEST_ELEMENT) throw new Error(`not a WebM element of ${size.value} bytes`);
    const end = start + size.value;
    if (end > bytes.length) return;
    yield { id: id.value, body: bytes.subarray(start, end), end };
    at = end;
  }
}

/**
 * A number whose first bits say how many bytes it has (RFC 8794, 4).
 *
 * @param {Uint8Array} bytes
 * @param {number} at
 * @param {boolean} marked the bit that says so belongs to it, as in the name of an element
 */
function number(bytes, at, marked) {
  if (at >= bytes.length) return null;
  const length = Math.clz32(bytes[at]) - 23;
  if (length > 8) throw new Error('not a WebM number');
  if (at + length > bytes.length) return null;
  let value = marked ? bytes[at] : bytes[at] & ((1 << (8 - length)) - 1);
  for (let i = 1; i < length; i += 1) value = value * 256 + bytes[at + i];
  return { value, length };
}

/**
 * @param {Uint8Array} cluster
 * @returns {number} seconds
 */
function time(cluster) {
  for (const { id, body } of elements(cluster)) {
    if (id === TIMESTAMP) return body.reduce((value, byte) => value * 256 + byte, 0) / TICKS;
  }
  throw new Error('a WebM cluster without a time');
}
