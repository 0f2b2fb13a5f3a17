/** Paints every frame as it is shown: its boxes, and the part of it that is followed. */

import { take, watchFrames } from './frames.js';

/** @import {Overlay} from './overlay.js' */
/** @import {Viewer} from '../viewer.js' */

export class Painter {
  /** @type {string | null | undefined} */
  #camera;

  /**
   * @param {HTMLVideoElement} video
   * @param {Viewer} viewer
   * @param {Overlay} overlay
   * @param {(camera: string | null) => void} cut another camera is shown
   * @param {() => void} shown a frame is
   */
  constructor(video, viewer, overlay, cut, shown) {
    this.video = video;
    this.viewer = viewer;
    this.overlay = overlay;
    watchFrames(video, () => this.#wanted, (frame) => {
      if (viewer.player.landing) return frame.image?.close(); // told of again, when it is known whose it is
      viewer.now.take(frame);
      this.#paint(frame.image);
      shown();
      if (viewer.probe.camera === this.#camera) return;
      this.#camera = viewer.probe.camera;
      cut(this.#camera);
    });
  }

  /** Between frames: another choice, boxes on or off, another size. */
  repaint() {
    const { video, viewer } = this;
    if (viewer.probe.pulse === null || viewer.player.landing) return;
    const frame = take(video, viewer.now.mediaTime, this.#wanted);
    if (frame.image) viewer.now.take({ ...frame, shownAt: Date.now() });
    this.#paint(frame.image);
  }

  /** Whether the picture is painted here, and not only shown by the video element. */
  get #wanted() {
    return this.viewer.boxesOn || this.viewer.now.framing.on;
  }

  /** @param {VideoFrame | null} image of the frame now shown */
  #paint(image) {
    const { site, object, boxesOn } = this.viewer;
    const { boxes, part } = this.viewer.now;
    if (site && this.#wanted) this.overlay.draw(boxesOn ? boxes : [], object, site, image, part);
    else this.overlay.clear();
    this.video.style.transform = site && !image ? this.overlay.transform(site) : 'none';
    image?.close();
  }
}
