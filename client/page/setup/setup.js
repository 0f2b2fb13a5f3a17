/** Entry point of the set-up page: finds and tries cameras, names them, writes the configuration, and waits for the site. */

import { CameraSearch } from '../shared/camera_search.js';
import { element, setText } from '../shared/dom.js';
import { pause, requestOperator, untilAnswered } from '../shared/requests.js';
import { exchangeTokenInLink } from '../shared/sign_in.js';
import { AddedCameras } from './added_cameras.js';
import { SiteForm } from './site_form.js';

/** @import {SetupState, WrittenSite} from './api_types.js' */

const POLL_MS = 500;
const TIMEOUT_MS = 3000;

const added = new AddedCameras(show, showError);
const search = new CameraSearch(element('camera-search'), { path: 'setup/cameras', request: (trial) => trial, showResult: showAdded }, showError);
const form = new SiteForm(started, showError);

/** @param {unknown} error null: no error */
function showError(error) {
  setText(element('error-message'), error instanceof Error ? error.message : '');
}

/** @param {SetupState} state */
function show(state) {
  showError(null);
  element('steps').hidden = false;
  added.show(state.cameras);
  form.show(state);
}

/** @param {SetupState} state */
async function showAdded(state) {
  show(state);
  return 'was added';
}

/** @param {WrittenSite} written */
async function started({ file, kept }) {
  element('steps').hidden = true;
  element('started').hidden = false;
  showError(null);
  setText(element('started-state'), `Written to ${file}. The site starts…`);
  if (kept) setText(element('kept'), `The earlier file is ${kept}.`);
  while (!(await siteRuns())) await pause(POLL_MS);
  setText(element('started-state'), `The site runs, as written in ${file}. Calibrated cameras tell people apart much better.`);
  element('started-links').hidden = false;
}

/** @returns {Promise<boolean>} whether the site has taken the place of this page's server */
async function siteRuns() {
  try {
    return (await fetch('healthz', { cache: 'no-store', signal: AbortSignal.timeout(TIMEOUT_MS) })).ok;
  } catch {
    return false;
  }
}

/** Sign in by the page's address, and show what there is to set up. */
async function enter() {
  try {
    await exchangeTokenInLink(showError);
    show(await untilAnswered(() => requestOperator('setup'), showError));
    search.resume();
    await search.run();
  } catch (error) {
    showError(error);
  }
}

void enter();
