/** Entry point of the operator's page: signs in, creates its sections and shows the one in the address. */

import { ServerEvents } from '../shared/events.js';
import { element, setText } from '../shared/dom.js';
import { getJson, HttpError, requestOperator, untilAnswered } from '../shared/requests.js';
import { CameraTiles } from './camera_tiles.js';
import { setNames } from '../people/names.js';
import { ViewSelectionForm } from './view_selection.js';
import { ConfigurationTable } from './configuration.js';
import { FloorPlan } from './floor_plan.js';
import { Downloads } from './downloads.js';
import { FlagList } from './assist/flag_list.js';
import { IgnoredAreas } from './marking/ignored_areas.js';
import { ZoneEditor } from './zones/zone_editor.js';
import { PeopleEditor } from './people_editor.js';
import { CalibrationWalk } from './calibration/walk.js';
import { CalibrationPoints } from './calibration/points.js';
import { Palette } from '../people/palette.js';
import { CamerasSection, SiteCameras } from './site_cameras.js';
import { SiteSettings } from './site_settings.js';
import { SiteRestart } from './site_restart.js';
import { SignIn } from '../shared/sign_in.js';

/** @import {Session, Site} from '../shared/api_types.js' */
/** @import {Section} from './section.js' */

/** @type {Map<string, Section>} by id of its element */
const sections = new Map();
/** @type {string | null} */
let openSection = null;

const signIn = new SignIn(() => void enter(), showError);

/** @param {unknown} error null: no error */
function showError(error) {
  setText(element('error-message'), error instanceof Error ? error.message : '');
  if (error instanceof HttpError && error.status === 401) askForToken();
}

function askForToken() {
  showSection(null);
  signIn.showForm();
}

async function enter() {
  try {
    const session = await untilAnswered(() => signIn.getSession(), showError);
    if (!session) return showSection(null);
    if (session.role !== 'operate') return await showRefusal(session);
    const site = await untilAnswered(() => getJson('api/site'), showError);
    showError(null);
    if (!sections.size) createSections(site);
    showSection(location.hash.slice(1));
  } catch (error) {
    showError(error);
  }
}

/** @param {Session} session without the operator's rights: an operator's request makes the server explain why */
async function showRefusal({ by_token: byToken }) {
  if (byToken) askForToken();
  await requestOperator('config').catch(showError);
}

/** @param {Site} site */
function createSections(site) {
  const palette = new Palette(site.cameras);
  element('site').textContent = site.name;
  document.documentElement.style.setProperty('--picture', String(site.width / site.height));
  const floor = new FloorPlan(site, palette, showError);
  const people = new PeopleEditor(site, showError);
  const flags = new FlagList(site, showError);
  const downloads = new Downloads(site);
  const restart = new SiteRestart(showError);
  const configured = new SiteCameras(showError, () => restart.check());
  sections.set('cameras', new CamerasSection(new CameraTiles(palette, showError), configured, new SiteSettings(showError, () => restart.check())));
  sections.set('floor', floor);
  sections.set('people', people);
  sections.set('flags', flags);
  sections.set('downloads', downloads);
  sections.set('zones', new ZoneEditor(site, palette, floor, showError, () => restart.check()));
  sections.set('ignored-areas', new IgnoredAreas(site, showError));
  sections.set('calibration', new CalibrationWalk(showError, () => restart.check()));
  sections.set('calibration-points', new CalibrationPoints(site, showError, () => restart.check()));
  sections.set('view-selection', new ViewSelectionForm(showError));
  sections.set('configuration', new ConfigurationTable(showError));
  new ServerEvents({
    opened: () => {
      showError(null);
      void restart.check();
      flags.open(); // a restarted service has other flags
    },
    lost: () => showError(new Error('Connection lost; retrying.')),
    received: (name, data) => {
      if (name === 'gop') floor.add(data);
      if (name === 'flag') flags.update(data);
      if (name === 'objects') {
        setNames(data.objects);
        people.show(data.objects);
        downloads.show(data.objects);
      }
    },
  });
}

/** @param {string | null} requested section, or an unknown name for the first one; null: none, before sign-in */
function showSection(requested) {
  const [first] = sections.keys();
  const next = requested === null ? null : sections.has(requested) ? requested : first;
  element('sections').hidden = next === null;
  if (openSection !== null && openSection !== next) sections.get(openSection)?.close();
  for (const name of sections.keys()) {
    element(name).hidden = name !== next;
    const link = document.querySelector(`#sections a[href="#${name}"]`);
    if (name === next) link?.setAttribute('aria-current', 'page');
    else link?.removeAttribute('aria-current');
  }
  if (next !== null && next !== openSection) sections.get(next)?.open();
  openSection = next;
}

addEventListener('hashchange', () => {
  if (openSection !== null) showSection(location.hash.slice(1));
});
addEventListener('beforeunload', (event) => {
  if ([...sections.values()].some(({ isUnsaved }) => isUnsaved)) event.preventDefault(); // the browser asks
});
void signIn.signInByLink().then(enter);
