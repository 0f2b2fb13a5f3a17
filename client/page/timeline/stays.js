/** Stays of people in the past: the address of a search, stays from several answers, and their labels. */

/** @import {Box} from '../shared/api_types.js' */

/**
 * @typedef {object} PastStay an entry of /api/past/search
 * @property {number} object
 * @property {string | null} run an earlier run of the service, whose numbers are other people
 * @property {string | null} name
 * @property {string | null} zone
 * @property {string | null} camera
 * @property {number} first pulse
 * @property {number} frames
 * @property {string | null} begins UTC, ISO 8601
 * @property {number} seconds
 * @property {string[]} cameras that saw them
 * @property {string | null} clip address of the recorded view
 *
 * @typedef {object} PastQuestion
 * @property {string} from
 * @property {string | null} to null: now
 * @property {string} place anywhere, zones, cameras, places (both), zone:ID or camera:ID
 * @property {number | null} object null: everybody
 */

const LIMIT = 200; // stays of an answer, and on the page
const CROP = 1.25; // size of a picture over that of the person in it
const JOIN_S = 3; // the longest absence within a stay, as the server's default

/**
 * @param {PastQuestion} question
 * @param {string} order time, newest or longest
 * @returns {string} address relative to the page
 */
export function searchAddress({ from, to, place, object }, order) {
  const query = new URLSearchParams({ from });
  if (to !== null) query.set('to', to);
  const [kind, id] = split(place);
  if (kind === 'zone' || kind === 'camera') query.set(kind, id);
  if (kind === 'zones' || kind === 'places') query.set('zone', '*');
  if (kind === 'cameras' || kind === 'places') query.set('camera', '*');
  if (object !== null) query.set('object', String(object));
  query.set('order', order);
  query.set('limit', String(LIMIT));
  return `api/past/search?${query}`;
}

/** @param {string} place */
function split(place) {
  const at = place.indexOf(':');
  return at < 0 ? [place, ''] : [place.slice(0, at), place.slice(at + 1)];
}

/**
 * Join stays that the end of one answer has cut, and order them.
 *
 * @param {PastStay[]} stays
 * @param {string} order time, newest or longest
 * @param {number} fps
 * @returns {PastStay[]} at most as many as one answer has
 */
export function joinStays(stays, order, fps) {
  /** @type {PastStay[]} */
  const joined = [];
  /** @type {Map<string, PastStay>} */
  const last = new Map();
  for (const stay of [...stays].sort((a, b) => a.first - b.first)) {
    const key = JSON.stringify([stay.run, stay.object, stay.zone, stay.camera]);
    const before = last.get(key);
    if (before && stay.first - (before.first + before.frames) <= JOIN_S * fps) {
      before.frames = Math.max(before.frames, stay.first + stay.frames - before.first);
      before.seconds = before.frames / fps;
      continue;
    }
    const copy = { ...stay };
    last.set(key, copy);
    joined.push(copy);
  }
  if (order === 'newest') joined.reverse();
  if (order === 'longest') joined.sort((a, b) => b.frames - a.frames);
  return joined.slice(0, LIMIT);
}

/**
 * @param {Box} box of the person to show
 * @param {number} width of the picture
 * @param {number} height
 * @returns {[number, number, number, number]} left, top, right, bottom of a part of the picture, of the same shape
 */
export function cropAround([, left, top, right, bottom], width, height) {
  const share = Math.min(1, CROP * Math.max((bottom - top) / height, (right - left) / width));
  const [w, h] = [share * width, share * height];
  const x = Math.min(Math.max(0, (left + right - w) / 2), width - w);
  const y = Math.min(Math.max(0, (top + bottom - h) / 2), height - h);
  return [x, y, x + w, y + h];
}

/**
 * @param {number} seconds
 * @returns {string} such as "8 s", "2 min 5 s" or "1 h 20 min"
 */
export function duration(seconds) {
  const whole = Math.max(1, Math.round(seconds));
  const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
  if (hours) return `${hours} h ${minutes} min`;
  return minutes ? `${minutes} min ${whole % 60} s` : `${whole} s`;
}

/**
 * @param {PastStay} stay
 * @param {Date} now
 * @returns {string} when it began, with the day if that is another, and how long it lasted
 */
export function when({ begins, seconds }, now) {
  if (begins === null) return duration(seconds);
  const time = new Date(begins);
  const isToday = time.toDateString() === now.toDateString();
  return `${isToday ? time.toLocaleTimeString() : time.toLocaleString()}, ${duration(seconds)}`;
}
