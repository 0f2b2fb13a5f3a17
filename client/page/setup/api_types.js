/**
 * JSON of the set-up interface (api/operator/setup) as types, for the type checker. No code.
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
