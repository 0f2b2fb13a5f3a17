/** From what is known to the state of the page and the few words that say it. */

/**
 * @typedef {'starting' | 'unsupported' | 'lost' | 'empty' | 'unknown' | 'paused' | 'waiting' | 'away' | 'playing'} State
 *
 * @typedef {object} Facts
 * @property {boolean} supported whether this browser can play the streams
 * @property {boolean} connected
 * @property {boolean} known whether the list of people has come
 * @property {number} people how many are known
 * @property {number | null} object the chosen person
 * @property {boolean} listed whether the chosen person is among the known
 * @property {boolean} visible whether any camera sees the chosen person now
 * @property {boolean} paused
 * @property {boolean} moving whether frames of the chosen person are being shown
 *
 * @typedef {object} Status
 * @property {State} state
 * @property {string} title empty when the picture says it all
 * @property {string} text
 */

/**
 * @param {Facts} facts
 * @returns {Status}
 */
export function describe(facts) {
  return link(facts) ?? whom(facts) ?? picture(facts);
}

/**
 * @param {Facts} facts
 * @returns {Status | null}
 */
function link({ supported, connected, known }) {
  if (!supported) {
    return say('unsupported', 'No live video here', 'This browser cannot play it. Any current one can.');
  }
  if (!connected) {
    if (!known) return say('starting', 'Connecting…', '');
    return say('lost', 'Connection lost — trying again', 'The picture comes back by itself.');
  }
  return known ? null : say('starting', 'Connecting…', '');
}

/**
 * @param {Facts} facts
 * @returns {Status | null}
 */
function whom({ object, people, listed }) {
  if (object !== null && !listed) {
    return say('unknown', `Person ${object} is not here`, 'Choose somebody else, or wait: the view opens as they appear.');
  }
  if (object !== null) return null;
  if (people === 0) return say('empty', 'Nobody yet', 'Whoever walks into a camera’s view appears here.');
  return say('empty', 'Nobody in view', 'Choose somebody, or wait for the next to appear.');
}

/**
 * @param {Facts} facts
 * @returns {Status}
 */
function picture({ object, visible, paused, moving }) {
  if (paused && !moving) return say('paused', 'Paused', 'Press the picture to go on.');
  if (!visible) return say('away', `Person ${object} is out of view`, 'Waiting for a camera to see them again.');
  if (!moving) return say('waiting', 'Waiting for the picture…', '');
  return say('playing', '', '');
}

/**
 * @param {State} state
 * @param {string} title
 * @param {string} text
 * @returns {Status}
 */
function say(state, title, text) {
  return { state, title, text };
}
