/** The actions of buttons, keys and presses on the viewer's page. */

import { element } from './shared/dom.js';
import { listenToKeys } from './shared/keys.js';
import { copy, pictureInPicture, saveSnapshot } from './shared/tools.js';

/** @import {FlagBanner} from './operator/assist/flag_banner.js' */
/** @import {SelectionCosts} from './people/selection_costs.js' */
/** @import {Overlay} from './player/overlay.js' */
/** @import {Painter} from './player/painter.js' */
/** @import {TimelineStrip} from './timeline/strip.js' */
/** @import {Viewer} from './viewer.js' */

const SKIP_S = 5;

/**
 * @param {object} parts
 * @param {HTMLVideoElement} parts.video
 * @param {Viewer} parts.viewer
 * @param {Painter} parts.painter
 * @param {Overlay} parts.overlay
 * @param {TimelineStrip} parts.strip
 * @param {SelectionCosts} parts.costs
 * @param {FlagBanner} parts.banner
 */
export function listenToControls({ video, viewer, painter, overlay, strip, costs, banner }) {
  const stage = element('stage');
  const more = /** @type {HTMLDetailsElement} */ (element('more'));

  /** @type {[string, string, () => void][]} id, key, action */
  const controls = [
    ['toggle-boxes', 'b', () => toggle('toggle-boxes', (viewer.boxesOn = !viewer.boxesOn))],
    ['toggle-follow', 'z', () => toggle('toggle-follow', (viewer.currentFrame.follow.on = !viewer.currentFrame.follow.on))],
    ['toggle-why', 'w', toggleWhy],
    ['toggle-sound', 'm', toggleSound],
    ['prefer', 'p', () => viewer.togglePrefer()],
    ['automatic', '0', () => viewer.hold(null)],
    ['pause', ' ', () => viewer.timeShift.togglePause()],
    ['live', 'End', () => viewer.timeShift.live()],
    ['full-screen', 'f', fullScreen],
    ['snapshot', 's', snapshot],
    ['copy-link', 'l', copyLink],
  ];
  for (const [id, , action] of controls) element(id).addEventListener('click', action);

  listenToKeys({
    ...Object.fromEntries(controls.map(([, key, action]) => [key, action])),
    ...Object.fromEntries([1, 2, 3, 4, 5, 6, 7, 8, 9].map((number) => [number, () => holdNumber(number)])),
    ArrowRight: () => viewer.step(1),
    ArrowLeft: () => viewer.step(-1),
    ',': () => viewer.timeShift.skip(-SKIP_S),
    '.': () => viewer.timeShift.skip(SKIP_S),
    h: () => banner.togglePointing(),
    Escape: () => (more.open = false),
  });

  /**
   * @param {string} id
   * @param {boolean} on
   */
  function toggle(id, on) {
    element(id).setAttribute('aria-pressed', String(on));
    painter.repaint();
  }

  function toggleWhy() {
    costs.toggle();
    toggle('toggle-why', costs.on);
  }

  /** The video starts muted: browsers block autoplay with sound. */
  function toggleSound() {
    if (!viewer.site?.sound) return;
    video.muted = !video.muted;
    toggle('toggle-sound', !video.muted);
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
    const copied = await copy(location.href);
    viewer.showNotice(copied ? 'Link copied.' : `Link to this person: ${location.href}`);
  }

  /** @param {number} number from 1, of a camera in the site's order */
  function holdNumber(number) {
    const camera = viewer.site?.cameras[number - 1];
    if (camera) viewer.hold(camera);
  }

  /** @param {MouseEvent} event */
  function personAt(event) {
    return viewer.site ? overlay.hit(viewer.currentFrame.boxes, viewer.site, event) : null;
  }

  /** @param {Event} event */
  function isInBanner({ target }) {
    return target instanceof Element && target.closest('#flags') !== null;
  }

  strip.surface.canvas.addEventListener('click', ({ offsetX }) => {
    const pulse = strip.pulseAt(offsetX);
    if (pulse === null) viewer.timeShift.live();
    else viewer.timeShift.watchFrom(pulse);
  });
  for (const name of ['play', 'pause']) {
    video.addEventListener(name, () => {
      element('pause').textContent = video.paused ? 'Play' : 'Pause';
    });
  }
  element('in-picture').addEventListener('click', () => void pictureInPicture(video).catch(() => undefined));
  element('in-picture').hidden = !document.pictureInPictureEnabled;
  document.addEventListener('click', ({ target }) => {
    if (target instanceof Element && target.closest('summary')?.parentElement !== more) more.open = false;
  });
  stage.addEventListener('mousemove', (event) => stage.classList.toggle('over-person', personAt(event) !== null));
  stage.addEventListener('click', (event) => {
    if (banner.pointing.object !== null || isInBanner(event)) return;
    const object = personAt(event);
    if (object !== null) viewer.select(object);
    else if (video.paused) viewer.timeShift.togglePause();
  });
}
