/** Puts the operator's page together: who may see it, and which of its sections is open. */

import { ServerEvents } from '../shared/events.js';
import { getJson } from '../shared/requests.js';
import { CameraTiles } from './cameras.js';
import { learnNames } from '../people/names.js';
import { ViewSelectionForm } from './view_selection.js';
import { Configuration } from './configuration.js';
import { FloorPlan } from './floor_plan.js';
import { Downloads } from './downloads.js';
import { FlagList } from './assist/flags.js';
import { ask, Refused } from './requests.js';
import { element } from './section.js';
import { ZoneEditor } from './zones.js';
import { KnownPeople } from './people.js';
import { CalibrationWalk } from './calibration.js';
import { Palette } from '../people/palette.js';
import { SignIn } from '../shared/sign_in.js';

/** @import {Session, Site} from '../shared/contract.js' */
/** @import {Section} from './section.js' */

/** @type {Map<string, Section>} */
const sections = new Map();
/** @type {string | null} */
let opened = null;

const signIn = new SignIn(() => void enter(), tell);

/** @param {unknown} error what went wrong; null: nothing */
function tell(error) {
  const line = error instanceof Error ? error.message : '';
  const trouble = element('trouble');
  if (trouble.textContent !== line) trouble.textContent = line; // or it is read out again
  if (error instanceof Refused && error.status === 401) askForToken();
}

function askForToken() {
  show(null);
  signIn.ask();
}

async function enter() {
  try {
    const session = await signIn.look();
    if (!session) return show(null);
    if (session.role !== 'operate') return await refused(session);
    const site = await getJson('api/site');
    tell(null);
    if (!sections.size) build(site);
    show(location.hash.slice(1));
  } catch (error) {
    tell(error);
  }
}

/** @param {Session} session of somebody who may not operate: the server says what it takes */
async function refused({ by_token: byToken }) {
  if (byToken) askForToken();
  await ask('config').catch(tell);
}

/** @param {Site} site */
function build(site) {
  const palette = new Palette(site.cameras);
  element('site').textContent = site.name;
  document.documentElement.style.setProperty('--picture', String(site.width / site.height));
  const floor = new FloorPlan(site, palette, tell);
  sections.set('cameras', new CameraTiles(palette, tell));
  sections.set('floor', floor);
  const known = new KnownPeople(site, tell);
  sections.set('known', known);
  const flags = new FlagList(site, tell);
  sections.set('flagged', flags);
  const downloads = new Downloads(site);
  sections.set('downloads', downloads);
  sections.set('zones', new ZoneEditor(site, tell));
  sections.set('calibration', new CalibrationWalk(tell));
  sections.set('view-selection', new ViewSelectionForm(tell));
  sections.set('configuration', new Configuration(tell));
  new ServerEvents({
    opened: () => {
      tell(null);
      flags.open(); // another run of the service has raised others
    },
    lost: () => tell(new Error('Connection lost; retrying.')),
    heard: (name, data) => {
      if (name === 'gop') floor.add(data);
      if (name === 'flag') flags.take(data);
      if (name === 'objects') {
        learnNames(data.objects);
        known.show(data.objects);
        downloads.show(data.objects);
      }
    },
  });
}

/** @param {string | null} wanted section; null: none, since nobody may see them */
function show(wanted) {
  const [first] = sections.keys();
  const next = wanted === null ? null : sections.has(wanted) ? wanted : first;
  element('sections').hidden = next === null;
  if (opened !== null && opened !== next) sections.get(opened)?.close();
  for (const name of sections.keys()) {
    element(name).hidden = name !== next;
    const link = document.querySelector(`#sections a[href="#${name}"]`);
    if (name === next) link?.setAttribute('aria-current', 'page');
    else link?.removeAttribute('aria-current');
  }
  if (next !== null && next !== opened) sections.get(next)?.open();
  opened = next;
}

addEventListener('hashchange', () => {
  if (opened !== null) show(location.hash.slice(1));
});
void signIn.begin().then(enter);
