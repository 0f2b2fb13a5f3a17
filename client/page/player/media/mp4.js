/**
 * Splits a fragmented MP4 stream (ISO/IEC 14496-12) into whole segments.
 *
 * Only whole segments are appended to a SourceBuffer, so that a stream can be cancelled at any byte and another
 * continue in its place.
 */

const MAX_BOX = 64 * 1024 * 1024; // bytes; a larger size means damaged data
const AUDIO_HANDLER = 0x736f756e; // "soun"

/**
 * @typedef {object} Segment
 * @property {'init' | 'media' | 'audio'} kind media: video
 * @property {Uint8Array} bytes
 * @property {number} start media time of the first frame, seconds; 0 for init and audio
 */

export class SegmentSplitter {
  /** @type {Uint8Array} bytes of an incomplete segment */
  #pending = new Uint8Array(0);
  #timescale = 0;
  /** @type {number | null} id of the audio track */
  #audioTrack = null;

  /**
   * @param {Uint8Array} chunk
   * @returns {Segment[]} the segments that are now complete
   * @throws {Error} when the data is not MP4
   */
  push(chunk) {
    this.#pending = concat([this.#pending, chunk]);
    const segments = [];
    let from = 0;
    for (const box of boxes(this.#pending)) {
      if (box.type !== 'moov' && box.type !== 'mdat') continue;
      segments.push(this.#segment(box.type, this.#pending.slice(from, box.end)));
      from = box.end;
    }
    this.#pending = this.#pending.slice(from);
    return segments;
  }

  /**
   * @param {string} last type of the box that ends the segment
   * @param {Uint8Array} bytes
   * @returns {Segment}
   */
  #segment(last, bytes) {
    if (last === 'moov') {
      this.#timescale = timescale(find(bytes, ['moov', 'trak', 'mdia', 'mdhd']));
      this.#audioTrack = audioTrackId(bytes);
      return { kind: 'init', bytes, start: 0 };
    }
    const track = find(bytes, ['moof', 'traf', 'tfhd']).getUint32(4);
    if (track === this.#audioTrack) return { kind: 'audio', bytes, start: 0 };
    const ticks = decodeTime(find(bytes, ['moof', 'traf', 'tfdt']));
    return { kind: 'media', bytes, start: ticks / this.#timescale };
  }
}

/**
 * @param {Uint8Array[]} parts
 * @returns {Uint8Array}
 */
export function concat(parts) {
  const whole = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.length;
  }
  return whole;
}

/**
 * Yield the complete boxes at the start of some bytes, in order.
 *
 * @param {Uint8Array} bytes
 */
function* boxes(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  let at = 0;
  while (at + 8 <= bytes.length) {
    let size = view.getUint32(at);
    let header = 8;
    if (size === 1) {
      if (at + 16 > bytes.length) return;
      size = Number(view.getBigUint64(at + 8));
      header = 16;
    }
    if (size < header || size > MAX_BOX) throw new Error(`not an MP4 box of ${size} bytes`);
    if (at + size > bytes.length) return;
    const type = String.fromCharCode(...bytes.subarray(at + 4, at + 8));
    yield { type, body: bytes.subarray(at + header, at + size), end: at + size };
    at += size;
  }
}

/**
 * @param {Uint8Array} bytes
 * @param {string[]} path
 * @returns {DataView} the body of the first box at that path
 */
function find(bytes, path) {
  let body = bytes;
  for (const type of path) {
    const box = [...boxes(body)].find((candidate) => candidate.type === type);
    if (!box) throw new Error(`no ${path.join('/')} in the MP4`);
    body = box.body;
  }
  return new DataView(body.buffer, body.byteOffset, body.byteLength);
}

/**
 * @param {Uint8Array} init
 * @returns {number | null}
 */
function audioTrackId(init) {
  const moov = [...boxes(init)].find((box) => box.type === 'moov');
  for (const { type, body } of boxes(moov?.body ?? new Uint8Array(0))) {
    if (type !== 'trak' || find(body, ['mdia', 'hdlr']).getUint32(8) !== AUDIO_HANDLER) continue;
    const tkhd = find(body, ['tkhd']);
    return tkhd.getUint32(tkhd.getUint8(0) === 1 ? 20 : 12);
  }
  return null;
}

/** @param {DataView} mdhd */
function timescale(mdhd) {
  return mdhd.getUint32(mdhd.getUint8(0) === 1 ? 20 : 12);
}

/** @param {DataView} tfdt */
function decodeTime(tfdt) {
  return tfdt.getUint8(0) === 1 ? Number(tfdt.getBigUint64(4)) : tfdt.getUint32(4);
}
