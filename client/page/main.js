/** Puts the parts on the page. */

import { Banner } from './operator/assist/flag_banner.js';
import { Cameras } from './people/cameras.js';
import { listenToControls } from './controls.js';
import { element } from './shared/element.js';
import { ServerEvents } from './shared/events.js';
import { Explaining } from './people/cost_queries.js';
import { person } from './people/names.js';
import { Overlay } from './player/overlay.js';
import { Painter } from './player/painter.js';
import { People } from './people/people.js';
import { Pointing } from './operator/assist/pointing.js';
import { Reason } from './people/selection_reason.js';
import { SignIn } from './shared/sign_in.js';
import { Span } from './timeline/span.js';
import { Strip } from './timeline/band.js';
import { Tiles } from './people/tiles.js';
import { SitePoller } from './player/server_clock.js';
import { Viewer } from './viewer.js';
import { Why } from './people/selection_costs.js';

const READOUT_MS = 250;
const DELAY_FRAMES = 25; // whose median is shown
const MISSING = '–';

const stage = element('stage');
/** @type {HTMLVideoElement} */
const video = element('video');
const [title, text] = /** @type {HTMLElement[]} */ ([...element('status').children]);

const viewer = new Viewer(video, show);
const people = new People(
  element('people'),
  element('earlier'),
  (object) => viewer.choose(object),
  (object) => viewer.toggleBeside(object),
);
const tiles = new Tiles(element('tiles'), viewer, (object) => viewer.choose(object));
const cameras = new Cameras(element('cameras'), (camera) => viewer.hold(camera));
const overlay = new Overlay(element('boxes'));
const strip = new Strip(element('strip'));
const span = new Span(element('span'), element('strip'), readOut);
const reason = new Reason(element('reason'));
const explaining = new Explaining(viewer, strip, new Why(element('why')));
const sitePoller = new SitePoller(viewer);
const painter = new Painter(video, viewer, overlay, markCamera, () => pointing.frame());
const pointing = new Pointing(stage, element('cross'), viewer, overlay, tellPointing);
const banner = new Banner(viewer, pointing);
Object.assign(window, { myview: viewer.probe });

/** Everything that does not change with every frame. */
function show() {
  const { site, override } = viewer;
  if (site) {
    element('site').textContent = site.name;
    element('toggle-sound').hidden = !site.sound;
    document.documentElement.style.setProperty('--picture', String(site.width / site.height));
    document.body.classList.add('ready');
    cameras.configure(site.cameras, viewer.palette);
    cameras.show(viewer.cameras);
    cameras.mark(viewer.probe.camera, override);
    element('automatic').hidden = element('prefer').hidden = override.camera === null;
    element('prefer').setAttribute('aria-pressed', String(override.prefers));
    element('live').hidden = viewer.timeShift.moment === null;
  }
  if (viewer.people) {
    people.show(viewer.people, viewer.object, viewer.tiles, viewer.palette, (person) => viewer.isGone(person));
    element('nobody').hidden = viewer.people.length > 0;
  }
  tiles.show(viewer.tiles);
  document.title = viewer.object === null ? 'MyView' : `${person(viewer.object)} · MyView`;
  readOut();
  painter.repaint();
  tiles.repaint();
}

/** What changes with time alone. */
function readOut() {
  const status = viewer.status();
  const { probe, site, palette, decisions, override } = viewer;
  stage.dataset.state = status.state;
  stage.classList.toggle('pictured', viewer.currentFrame.exists && !['unknown', 'empty'].includes(status.state));
  write(title, status.title);
  write(text, status.text);
  write(element('notice'), viewer.notice.text);
  banner.show();
  const delay = median(probe.delays.slice(-DELAY_FRAMES).map(({ delayMs }) => delayMs ?? NaN));
  element('delay').textContent = viewer.currentFrame.advancing && delay > 0 ? `${(delay / 1000).toFixed(1)} s` : MISSING;
  if (!viewer.currentFrame.mapped) reason.put('This browser reports no frame times: no boxes, no past, no reasons.');
  if (!site || !viewer.currentFrame.mapped || probe.pulse === null || viewer.object === null) return strip.clear();
  const live = viewer.timeShift.moment === null;
  const views = (/** @type {number} */ from) => viewer.views(from);
  void viewer.kept.about(viewer.object);
  const seconds = span.offer((decisions.end - viewer.kept.first) / site.fps);
  strip.draw({ pulse: probe.pulse, live, fps: site.fps, seconds, decided: decisions.end, views, palette });
  explaining.follow();
  const best = viewer.decisionsAt(probe.pulse).camera(viewer.object, probe.pulse);
  const words = override.words(best, probe.camera, live);
  if (words === null) void reason.about(viewer.object, probe.camera, live ? null : probe.pulse);
  else reason.put(words);
}

/**
 * Only where it is another: what is written is read out.
 *
 * @param {HTMLElement} place
 * @param {string} words
 */
function write(place, words) {
  if (place.textContent !== words) place.textContent = words;
}

/** @param {number[]} values */
function median(values) {
  return values.sort((a, b) => a - b)[Math.floor(values.length / 2)] ?? NaN;
}

/** @param {string | null} camera now shown */
function markCamera(camera) {
  cameras.mark(camera, viewer.override);
  element('camera').textContent = camera ?? '';
  element('camera').style.setProperty('--camera', camera ? viewer.palette.colour(camera) : 'none');
  if (viewer.probe.pulse !== null) readOut();
}

const signIn = new SignIn(() => location.reload(), tellSignIn);

/** @param {unknown} error why nobody could be signed in; null: they were */
function tellSignIn(error) {
  write(element('sign-in-trouble'), error instanceof Error ? error.message : '');
}

/** A server that needs a token looks like one that is away, to whom has none; one that is away says nothing. */
async function lookWhoMay() {
  const session = await signIn.look().catch(() => null);
  if (session?.role === 'operate') await pointing.look();
  else pointing.possible = false;
  banner.show();
}

/** @param {unknown} error why the server does not take where the operator points; null: it does */
function tellPointing(error) {
  if (error instanceof Error) viewer.say(error.message);
}

listenToControls({ video, viewer, painter, overlay, strip, explaining, banner });
await signIn.begin();
new ServerEvents({
  opened: () => {
    viewer.setConnected(true);
    void sitePoller.connected();
    banner.flags.clear(); // those that are open are told again
    void lookWhoMay();
  },
  lost: () => {
    viewer.setConnected(false);
    void lookWhoMay();
  },
  heard: (name, data) => {
    if (name === 'gop') viewer.addGop(data);
    else if (name === 'site') viewer.setSite(data);
    else if (name === 'objects') viewer.setPeople(data.objects);
    else if (name === 'cameras') viewer.setCameras(data.cameras);
    else if (name === 'flag') banner.take(data);
  },
});
new ResizeObserver(() => {
  painter.repaint();
  tiles.repaint();
}).observe(stage);
setInterval(readOut, READOUT_MS);
