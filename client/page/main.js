/** Entry point of the viewer's page: creates its parts and updates them. */

import { FlagBanner } from './operator/assist/flag_banner.js';
import { CameraLegend } from './people/camera_legend.js';
import { listenToControls } from './controls.js';
import { DELAY_REASONS, DelayChoice } from './player/delay_choice.js';
import { element, setText } from './shared/dom.js';
import { ServerEvents } from './shared/events.js';
import { SelectionCosts } from './people/selection_costs.js';
import { longLabel } from './people/names.js';
import { PastSearch } from './timeline/past_search.js';
import { Overlay } from './player/overlay.js';
import { Painter } from './player/painter.js';
import { PeopleElsewhere } from './people/elsewhere.js';
import { PersonCards } from './people/person_cards.js';
import { Pointing } from './operator/assist/pointing.js';
import { SelectionReason } from './people/selection_reason.js';
import { SignIn } from './shared/sign_in.js';
import { RangeSelect, TimelineStrip } from './timeline/strip.js';
import { Tiles } from './people/tiles.js';
import { SitePoller } from './player/server_clock.js';
import { Viewer } from './viewer.js';

const READOUT_MS = 250;
const DELAY_FRAMES = 25; // whose median is shown
const UNKNOWN = '–';
const BLURRED = { others: 'other people are blurred', everybody: 'people are blurred' };

const stage = element('stage');
/** @type {HTMLVideoElement} */
const video = element('video');
const [title, text] = /** @type {HTMLElement[]} */ ([...element('status').children]);

/** @type {ServerEvents | null} */
let events = null;
const viewer = new Viewer(video, update);
const cards = new PersonCards(
  element('people'),
  element('earlier'),
  (object) => viewer.select(object),
  (object) => viewer.toggleTile(object),
);
const elsewhere = new PeopleElsewhere(/** @type {HTMLDetailsElement} */ (element('elsewhere')), viewer);
const tiles = new Tiles(element('tiles'), viewer, (object) => viewer.select(object));
const legend = new CameraLegend(element('cameras'), (camera) => viewer.hold(camera));
const overlay = new Overlay(element('boxes'));
const strip = new TimelineStrip(element('strip'));
const range = new RangeSelect(element('span'), element('strip'), updateReadout);
const reason = new SelectionReason(element('reason'));
const delayChoice = new DelayChoice(element('delay-choice'), (delay) => viewer.chooseDelay(delay));
const search = new PastSearch(viewer);
const costs = new SelectionCosts(viewer, strip, element('why'));
const sitePoller = new SitePoller(viewer);
const painter = new Painter(video, viewer, overlay, showCamera, () => pointing.addFrame());
const pointing = new Pointing(stage, element('cross'), viewer, overlay, showPointingError);
const banner = new FlagBanner(viewer, pointing);
Object.assign(window, { myview: viewer.probe });

/** Update everything that does not change with every frame. */
function update() {
  const { site, preference } = viewer;
  if (site) {
    element('site').textContent = site.blur ? `${site.name} · ${BLURRED[site.blur]}` : site.name;
    element('toggle-sound').hidden = !site.sound;
    document.documentElement.style.setProperty('--picture', String(site.width / site.height));
    document.body.classList.add('ready');
    legend.configure(site.cameras, viewer.palette);
    legend.show(viewer.cameras);
    legend.mark(viewer.probe.camera, preference);
    element('automatic').hidden = element('prefer').hidden = preference.camera === null;
    element('prefer').setAttribute('aria-pressed', String(preference.prefers));
    element('live').hidden = viewer.timeShift.moment === null;
  }
  if (viewer.people) {
    cards.show(viewer.people, viewer.object, viewer.tiles, viewer.palette, (person) => viewer.isGone(person));
    element('no-people').hidden = viewer.people.length > 0;
  }
  search.update();
  delayChoice.show(viewer.delays, viewer.delay);
  events?.choose(viewer.delay);
  tiles.show(viewer.tiles);
  document.title = viewer.object === null ? 'MyView' : `${longLabel(viewer.object)} · MyView`;
  updateReadout();
  painter.repaint();
  tiles.repaint();
}

/** Update what changes with time. */
function updateReadout() {
  const status = viewer.status();
  const { probe, site, palette, decisions, preference, currentFrame } = viewer;
  stage.dataset.state = status.state;
  stage.classList.toggle('pictured', currentFrame.exists && !['unknown', 'empty'].includes(status.state));
  setText(title, status.title);
  setText(text, status.text);
  setText(element('notice'), viewer.notice.text);
  banner.show();
  const delay = median(probe.delays.slice(-DELAY_FRAMES).map(({ delayMs }) => delayMs ?? NaN));
  element('delay').textContent = currentFrame.advancing && delay > 0 ? `${(delay / 1000).toFixed(1)} s` : UNKNOWN;
  if (!currentFrame.mapped) reason.replace('This browser reports no frame times: no boxes, no past, no reasons.');
  if (!site || !currentFrame.mapped || probe.pulse === null || viewer.object === null) return strip.clear();
  const live = viewer.timeShift.moment === null;
  const views = (/** @type {number} */ from) => viewer.views(from);
  if (!site.blur) void viewer.recordedViews.refresh(viewer.object);
  const seconds = range.update((decisions.end - viewer.recordedViews.first) / site.fps);
  strip.draw({ pulse: probe.pulse, live, fps: site.fps, seconds, decided: decisions.end, views, palette });
  costs.update();
  const best = viewer.decisionsAt(probe.pulse).camera(viewer.object, probe.pulse);
  const preferenceReason = preference.reason(best, probe.camera, live);
  const delayReason = live && viewer.delay !== null ? DELAY_REASONS[viewer.delay] : undefined;
  if (preferenceReason !== null) reason.replace(preferenceReason);
  else if (delayReason !== undefined) reason.replace(delayReason);
  else void reason.refresh(viewer.object, probe.camera, live ? null : probe.pulse);
}

/** @param {number[]} values */
function median(values) {
  return values.sort((a, b) => a - b)[Math.floor(values.length / 2)] ?? NaN;
}

/** @param {string | null} camera displayed */
function showCamera(camera) {
  legend.mark(camera, viewer.preference);
  element('camera').textContent = camera ?? '';
  element('camera').style.setProperty('--camera', camera ? viewer.palette.color(camera) : 'none');
  if (viewer.probe.pulse !== null) updateReadout();
}

const signIn = new SignIn(() => location.reload(), showSignInError);

/** @param {unknown} error null: no error */
function showSignInError(error) {
  setText(element('sign-in-error'), error instanceof Error ? error.message : '');
}

/** Update the visitor's rights. Without a token the server's events fail like a lost connection, so ask after both. */
async function updateRights() {
  const session = await signIn.getSession().catch(() => null);
  if (session?.role === 'operate') await pointing.updateAvailability();
  else pointing.available = false;
  banner.show();
}

/** @param {unknown} error null: no error */
function showPointingError(error) {
  if (error instanceof Error) viewer.showNotice(error.message);
}

listenToControls({ video, viewer, painter, overlay, strip, costs, banner });
await signIn.signInByLink();
events = new ServerEvents({
  opened: () => {
    viewer.setConnected(true);
    void sitePoller.connected();
    banner.flags.clear(); // the server sends the open ones again
    void updateRights();
  },
  lost: () => {
    viewer.setConnected(false);
    void updateRights();
  },
  received: (name, data) => {
    if (name === 'gop') viewer.addGop(data);
    else if (name === 'site') viewer.setSite(data);
    else if (name === 'objects') {
      viewer.setPeople(data.objects);
      elsewhere.show(data.elsewhere ?? []);
    } else if (name === 'cameras') viewer.setCameras(data.cameras);
    else if (name === 'delays') viewer.setDelays(data.delays);
    else if (name === 'flag') banner.update(data);
  },
}, viewer.delay);
new ResizeObserver(() => {
  painter.repaint();
  tiles.repaint();
}).observe(stage);
setInterval(updateReadout, READOUT_MS);
