/** The state of the viewer's page and the text that describes it. */

/**
 * @typedef {'starting' | 'unsupported' | 'lost' | 'empty' | 'unknown' | 'paused' | 'waiting' | 'away' | 'playing'} State
 *
 * @typedef {object} Facts
 * @property {boolean} supported whether this browser can play the streams
 * @property {boolean} connected
 * @property {boolean} known whether the list of people was received
 * @property {number} people number of people on the list
 * @property {number | null} object the selected person
 * @property {boolean} listed whether the selected person is on the list
 * @property {boolean} visible whether a camera sees the selected person now
 * @property {boolean} paused
 * @property {boolean} moving whether new frames of the selected person are displayed
 *
 * @typedef {object} Status
 * @property {State} state
 * @property {string} title empty while the person is displayed live
 * @property {string} text
 */

/**
 * @param {Facts} facts
 * @returns {Status}
 */
export function describe(facts) {
  return connectionStatus(facts) ?? personStatus(facts) ?? playbackStatus(facts);
}

/**
 * @param {Facts} facts
 * @returns {Status | null}
 */
function connectionStatus({ supported, connected, known }) {
  if (!supported) {
    return status('unsupported', 'No live video here', 'This browser cannot play it. Any current one can.');
  }
  if (!connected) {
    if (!known) return status('starting', 'Connecting…', '');
    return status('lost', 'Connection lost, reconnecting', 'The video will resume.');
  }
  return known ? null : status('starting', 'Connecting…', '');
}

/**
 * @param {Facts} facts
 * @returns {Status | null}
 */
function personStatus({ object, people, listed }) {
  if (object !== null && !listed) {
    return status('unknown', `Person ${object} is not here`, 'Choose someone else, or wait until they appear.');
  }
  if (object !== null) return null;
  if (people === 0) return status('empty', 'No people yet', 'People appear here when a camera sees them.');
  return status('empty', 'No one in view', 'Choose a person, or wait for the next to appear.');
}

/**
 * @param {Facts} facts
 * @returns {Status}
 */
function playbackStatus({ object, visible, paused, moving }) {
  if (paused && !moving) return status('paused', 'Paused', 'Press the picture to resume.');
  if (!visible) return status('away', `Person ${object} is out of view`, 'Waiting for a camera to see them again.');
  if (!moving) return status('waiting', 'Waiting for the video…', '');
  return status('playing', '', '');
}

/**
 * @param {State} state
 * @param {string} title
 * @param {string} text
 * @returns {Status}
 */
function status(state, title, text) {
  return { state, title, text };
}
