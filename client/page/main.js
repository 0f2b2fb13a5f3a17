/** Puts the parts on the page. */

import { Cameras } from './cameras.js';
import { ServerClock } from './clock.js';
import { ServerEvents } from './events.js';
import { take, watchFrames } from './frames.js';
import { getJson, pause } from './http.js';
import { listenToKeys } from './keys.js';
import { Overlay } from './overlay.js';
import { People } from './people.js';
import { Reason } from './reason.js';
import { Strip } from './strip.js';
import { Tiles } from './tiles.js';
import { copy, pictureInPicture, saveSnapshot } from './tools.js';
import { Viewer } from './viewer.js';
import { Why } from './why.js';

const READOUT_MS = 250;
const CLOCK_EVERY_MS = 10_000;
const CLOCK_SAMPLES = 4; // one after the other, at every connection
const DELAY_FRAMES = 25; // whose median is shown
const SKIP_S = 5;
const MISSING = '–';

/**
 * @template {HTMLElement} T
 * @param {string} id
 * @returns {T}
 */
function element(id) {
  return /** @type {T} */ (document.getElementById(id));
}

const stage = element('stage');
/** @type {HTMLVideoElement} */
const video = element('video');
/** @type {HTMLButtonElement} */
const toggle = element('toggle-boxes');
/** @type {HTMLButtonElement} */
const followToggle = element('toggle-follow');
/** @type {HTMLButtonElement} */
const soundToggle = element('toggle-sound');
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
const reason = new Reason(element('reason'));
const stripElement = element('strip');
const why = new Why(element('why'));
const clock = new ServerClock();
Object.assign(window, { myview: viewer.probe });

/** Everything that does not change with every frame. */
function show() {
  const { site } = viewer;
  if (site) {
    element('site').textContent = site.name;
    soundToggle.hidden = !site.sound;
    document.documentElement.style.setProperty('--picture', String(site.width / site.height));
    document.body.classList.add('ready');
    cameras.configure(site.cameras, viewer.palette);
    cameras.show(viewer.cameras);
    cameras.mark(viewer.probe.camera, viewer.held);
    element('automatic').hidden = viewer.held === null;
    element('live').hidden = viewer.past === null;
  }
  if (viewer.people) {
    people.show(viewer.people, viewer.object, viewer.tiles, viewer.palette, (person) => viewer.isGone(person));
    element('nobody').hidden = viewer.people.length > 0;
  }
  tiles.show(viewer.tiles);
  document.title = viewer.object === null ? 'MyView' : `Person ${viewer.object} · MyView`;
  readOut();
  repaint();
}

/** What changes with time alone. */
function readOut() {
  const status = viewer.status();
  const { probe, site, palette, decisions } = viewer;
  stage.dataset.state = status.state;
  stage.classList.toggle('pictured', probe.pulse !== null && !['unknown', 'empty'].includes(status.state));
  if (title.textContent !== status.title) title.textContent = status.title; // or it is read out again
  if (text.textContent !== status.text) text.textContent = status.text;
  const notice = element('notice');
  if (notice.textContent !== viewer.notice) notice.textContent = viewer.notice;
  const delay = median(probe.delays.slice(-DELAY_FRAMES).map(({ delayMs }) => delayMs ?? NaN));
  element('delay').textContent = viewer.flowing && delay > 0 ? `${(delay / 1000).toFixed(1)} s` : MISSING;
  if (!site || probe.pulse === null || viewer.object === null) return strip.clear();
  const live = viewer.past === null;
  strip.draw({ pulse: probe.pulse, live, fps: site.fps, object: viewer.object, decisions, palette });
  if (whyOn && !stripElement.matches(':hover')) explain(probe.pulse);
  if (viewer.held === null) void reason.about(viewer.object, probe.camera, live ? null : probe.pulse);
  else reason.put(`Held by hand. ${best(decisions.camera(viewer.object, probe.pulse), viewer.held)}`);
}

/**
 * @param {string | null} camera that would be shown
 * @param {string} held
 */
function best(camera, held) {
  if (camera === null) return '';
  return camera === held ? 'It is the best view just now.' : `The best view just now is ${camera}.`;
}

/** @param {number[]} values */
function median(values) {
  return values.sort((a, b) => a - b)[Math.floor(values.length / 2)] ?? NaN;
}

/** Whether the picture is painted here, and not only shown by the video element. */
function painted() {
  return viewer.boxesOn || viewer.followOn;
}

/** @param {VideoFrame | null} image of the frame now shown */
function paint(image) {
  const { site, boxesOn, part } = viewer;
  if (site && painted()) overlay.draw(boxesOn ? viewer.boxes : [], viewer.object, site, image, part);
  else overlay.clear();
  video.style.transform = site && !image ? overlay.transform(site) : 'none';
  image?.close();
}

/** Between frames: another choice, boxes on or off, another size. */
function repaint() {
  if (viewer.probe.pulse === null || viewer.player.landing) return;
  const frame = take(video, viewer.mediaTime, painted());
  if (frame.image) viewer.shown({ ...frame, shownAt: Date.now() });
  paint(frame.image);
  tiles.repaint();
}

/** @type {string | null | undefined} */
let marked;
watchFrames(video, painted, (frame) => {
  if (viewer.player.landing) return frame.image?.close(); // told of again, when it is known whose it is
  viewer.shown(frame);
  paint(frame.image);
  const { camera } = viewer.probe;
  if (camera === marked) return;
  marked = camera;
  cameras.mark(camera, viewer.held);
  element('camera').textContent = camera ?? '';
  element('camera').style.setProperty('--camera', camera ? viewer.palette.colour(camera) : 'none');
  if (viewer.probe.pulse !== null) readOut();
});

function toggleBoxes() {
  viewer.boxesOn = !viewer.boxesOn;
  toggle.setAttribute('aria-pressed', String(viewer.boxesOn));
  repaint();
}

function toggleFollow() {
  viewer.followOn = !viewer.followOn;
  followToggle.setAttribute('aria-pressed', String(viewer.followOn));
  repaint();
}

/** Muted at first, or no browser would play by itself. */
function toggleSound() {
  if (!viewer.site?.sound) return;
  video.muted = !video.muted;
  soundToggle.setAttribute('aria-pressed', String(!video.muted));
}

function fullScreen() {
  if (document.fullscreenElement) void document.exitFullscreen();
  else void stage.requestFullscreen?.();
}

function snapshot() {
  const { site, object, probe } = viewer;
  if (!site || probe.pulse === null || !video.videoWidth) return;
  void saveSnapshot(video, `${site.name}-person-${object}-${probe.camera ?? 'camera'}-p${probe.pulse}`);
}

async function copyLink() {
  const done = await copy(location.href);
  viewer.say(done ? 'The link to this person is copied.' : `The link to this person: ${location.href}`);
}

let whyOn = false;
let explained = viewer.decisions;

function toggleWhy() {
  whyOn = !whyOn;
  element('toggle-why').setAttribute('aria-pressed', String(whyOn));
  element('why').classList.toggle('stays', whyOn);
  if (whyOn) explain(viewer.probe.pulse);
  else why.hide();
}

/** @param {number | null} pulse */
function explain(pulse) {
  const { site, object, probe, decisions } = viewer;
  if (decisions !== explained) why.forget(); // the pulses began anew
  explained = decisions;
  if (!site || object === null || pulse === null || probe.pulse === null) return why.hide();
  const ago = (probe.pulse - pulse) / site.fps;
  why.show(object, pulse, site.gop, ago < site.gop / site.fps ? 'Now' : `${ago.toFixed(1)} s before`);
}

/** @param {number} number from 1, of a camera in the site's order */
function holdNumber(number) {
  const camera = viewer.site?.cameras[number - 1];
  if (camera) viewer.hold(camera);
}

/** @param {MouseEvent} event */
function personAt(event) {
  return viewer.site ? overlay.hit(viewer.boxes, viewer.site, event) : null;
}

toggle.addEventListener('click', toggleBoxes);
soundToggle.addEventListener('click', toggleSound);
followToggle.addEventListener('click', toggleFollow);
element('full-screen').addEventListener('click', fullScreen);
stripElement.addEventListener('click', ({ offsetX }) => {
  const pulse = strip.pulseAt(offsetX);
  if (pulse === null) viewer.live();
  else viewer.watchFrom(pulse);
});
stripElement.addEventListener('pointermove', ({ offsetX, pointerType }) => {
  if (pointerType === 'mouse') explain(strip.pulseAt(offsetX));
});
stripElement.addEventListener('pointerleave', () => whyOn || why.hide());
element('toggle-why').addEventListener('click', toggleWhy);
element('live').addEventListener('click', () => viewer.live());
element('pause').addEventListener('click', () => viewer.pause());
for (const name of ['play', 'pause']) {
  video.addEventListener(name, () => {
    element('pause').textContent = video.paused ? 'Play' : 'Pause';
  });
}
element('automatic').addEventListener('click', () => viewer.hold(null));
element('snapshot').addEventListener('click', snapshot);
element('copy-link').addEventListener('click', copyLink);
element('in-picture').addEventListener('click', () => void pictureInPicture(video).catch(() => undefined));
const more = /** @type {HTMLDetailsElement} */ (element('more'));
document.addEventListener('click', ({ target }) => {
  if (target instanceof Element && target.closest('summary')?.parentElement !== more) more.open = false;
});
element('in-picture').hidden = !document.pictureInPictureEnabled;
listenToKeys({
  ArrowRight: () => viewer.step(1),
  ArrowLeft: () => viewer.step(-1),
  ' ': () => viewer.pause(),
  ',': () => viewer.skip(-SKIP_S),
  '.': () => viewer.skip(SKIP_S),
  End: () => viewer.live(),
  b: toggleBoxes,
  z: toggleFollow,
  w: toggleWhy,
  m: toggleSound,
  f: fullScreen,
  s: snapshot,
  l: copyLink,
  0: () => viewer.hold(null),
  ...Object.fromEntries([1, 2, 3, 4, 5, 6, 7, 8, 9].map((key) => [key, () => holdNumber(key)])),
  Escape: () => (more.open = false),
});
stage.addEventListener('mousemove', (event) => stage.classList.toggle('over-person', personAt(event) !== null));
stage.addEventListener('click', (event) => {
  const object = personAt(event);
  if (object !== null) viewer.choose(object);
  else if (video.paused) viewer.pause();
});

async function setClock() {
  try {
    const sent = Date.now();
    const site = await getJson('api/site');
    clock.add(sent, Date.now(), site.now);
    viewer.clockOffset = clock.offset;
    viewer.setSite(site);
  } catch {
    // The events say when the server is away, and when it is back.
  }
}

async function setClockWell() {
  clock.clear();
  for (let i = 0; i < CLOCK_SAMPLES; i += 1) {
    await setClock();
    await pause(READOUT_MS);
  }
}

new ServerEvents({
  opened: () => {
    viewer.setConnected(true);
    void setClockWell();
  },
  lost: () => viewer.setConnected(false),
  heard: (name, data) => {
    if (name === 'gop') viewer.addGop(data);
    else if (name === 'site') viewer.setSite(data);
    else if (name === 'objects') viewer.setPeople(data.objects);
    else viewer.setCameras(data.cameras);
  },
});
new ResizeObserver(repaint).observe(stage);
setInterval(readOut, READOUT_MS);
setInterval(setClock, CLOCK_EVERY_MS);
