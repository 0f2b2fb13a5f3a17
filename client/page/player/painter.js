/** Paints every displayed frame with its boxes, inside the viewport that follows the person. */

import { captureFrame, watchFrames } from './frames.js';

/** @import {Overlay} from './overlay.js' */
/** @import {Viewer} from '../viewer.js' */

export class Painter {
  /** @type {string | null | undefined} */
  #camera;

  /**
   * @param {HTMLVideoElement} video
   * @param {Viewer} viewer
   * @param {Overlay} overlay
   * @param {(camera: string | null) => void} onCut another camera is displayed
   * @param {() => void} onFrame a frame is displayed
   */
  constructor(video, viewer, overlay, onCut, onFrame) {
    this.video = video;
    this.viewer = viewer;
    this.overlay = overlay;
    watchFrames(video, () => this.#painting, (frame) => {
      if (viewer.player.isSwitching(frame.mediaTime)) return frame.image?.close(); // repainted when the switch is complete
      viewer.currentFrame.update(frame);
      this.#paint(frame.image);
      onFrame();
      if (viewer.probe.camera === this.#camera) return;
      this.#camera = viewer.probe.camera;
      onCut(this.#camera);
    });
  }

  /** Paint the current frame again after a change of selection, boxes or size. */
  repaint() {
    const { video, viewer } = this;
    if (viewer.probe.pulse === null) return;
    const frame = captureFrame(video, viewer.currentFrame.mediaTime, this.#painting);
    if (viewer.player.isSwitching(frame.mediaTime)) return frame.image?.close();
    if (frame.image) viewer.currentFrame.update({ ...frame, shownAt: Date.now() });
    this.#paint(frame.image);
  }

  /** Whether frames are painted here, and not only displayed by the video element. */
  get #painting() {
    return this.viewer.boxesOn || this.viewer.currentFrame.follow.on;
  }

  /** @param {VideoFrame | null} image of the displayed frame */
  #paint(image) {
    const { site, object, boxesOn } = this.viewer;
    const { boxes, viewport } = this.viewer.currentFrame;
    if (site && this.#painting) this.overlay.draw(boxesOn ? boxes : [], object, site, image, viewport);
    else this.overlay.clear();
    this.video.style.transform = site && !image ? this.overlay.transform(site) : 'none';
    image?.close();
  }
}
