/**
 * JSON of the set-up interface (api/operator/setup) as types, for the type checker. No code.
 *
 * @typedef {object} SearchedCamera that answered the search
 * @property {string} host
 * @property {number} port
 * @property {string} name
 * @property {string} hardware
 *
 * @typedef {object} SearchResult
 * @property {SearchedCamera[]} cameras
 * @property {string} hint why their streams cannot be asked for; empty: they can
 *
 * @typedef {object} OfferedStream of a camera
 * @property {number} key
 * @property {string} name
 * @property {string} codec
 * @property {number} width
 * @property {number} height
 * @property {number} fps
 *
 * @typedef {object} OfferedStreams the largest first
 * @property {string} error
 * @property {boolean} needs_password
 * @property {OfferedStream[]} streams
 * @property {number | null} source key of the stream proposed for viewers
 * @property {number | null} substream key of the stream proposed for tracking; null: the same
 *
 * @typedef {object} AddedCamera that was tried
 * @property {number} key
 * @property {string} name
 * @property {string} address without passwords
 * @property {string} sends
 * @property {string} tracked_in what its substream sends; empty: it has none
 *
 * @typedef {object} SetupState
 * @property {string} file
 * @property {boolean} exists
 * @property {AddedCamera[]} cameras
 * @property {{fps: number, width: number, height: number}} proposal
 *
 * @typedef {object} WrittenSite
 * @property {string} file
 * @property {string | null} kept where the earlier file is
 */
export {};
