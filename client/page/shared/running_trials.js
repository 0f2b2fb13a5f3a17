/** Trials that run, remembered for as long as this tab is open: the server goes on with them if the page is reloaded. */

const KEY = `myview-trials:${location.pathname}`;

/**
 * @typedef {object} TrialAim
 * @property {string} [camera] that gets the address; empty: a new one
 * @property {string} [name] of the new one
 *
 * @typedef {TrialAim & {trial: number, shown: string}} RunningTrial by its key, and what is shown of its address
 */

/** @returns {RunningTrial[]} */
export function runningTrials() {
  try {
    return JSON.parse(sessionStorage.getItem(KEY) ?? '[]');
  } catch {
    return []; // the browser stores nothing
  }
}

/**
 * @param {number} trial
 * @param {TrialAim & {shown: string}} details
 */
export function rememberTrial(trial, details) {
  store([...runningTrials(), { trial, ...details }]);
}

/** @param {number} trial */
export function forgetTrial(trial) {
  store(runningTrials().filter((running) => running.trial !== trial));
}

/** @param {RunningTrial[]} trials */
function store(trials) {
  try {
    sessionStorage.setItem(KEY, JSON.stringify(trials));
  } catch {
    // the browser stores nothing
  }
}
