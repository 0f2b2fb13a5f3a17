/**
 * Reports every displayed frame with its media time, and captures it so that it can be painted with its boxes.
 *
 * requestVideoFrameCallback reports the frame, but the browser may already show the next one when a canvas
 * over it is painted, so that boxes lag by a frame. A VideoFrame carries its own timestamp: a frame painted
 * from it always matches the boxes of that time. Browsers without either are accurate to about a frame.
 */

const SAME_TIMELINE_S = 0.5; // a VideoFrame timestamp further off counts from another origin
const SEEK_TIMEOUT_MS = 1000; // for two frames to be displayed after a seek, on a hidden page
const SEEK_TIMEOUT_VISIBLE_MS = 5000; // likewise, on a visible page of a busy browser

/**
 * @typedef {object} Frame
 * @property {number} mediaTime seconds
 * @property {number} shownAt Date.now() milliseconds
 * @property {VideoFrame | null} image to be closed by the receiver
 */

/**
 * @param {HTMLVideoElement} video
 * @param {() => boolean} needsImage whether to capture the frame's image
 * @param {(frame: Frame) => void} onFrame
 * @param {AbortSignal} [signal] stops the reports
 */
export function watchFrames(video, needsImage, onFrame, signal) {
  if (!('requestVideoFrameCallback' in video)) return pollFrames(video, needsImage, onFrame, signal);
  /** @type {VideoFrameRequestCallback} */
  const shown = (_now, { mediaTime, expectedDisplayTime }) => {
    if (signal?.aborted) return;
    video.requestVideoFrameCallback(shown);
    const shownAt = Date.now() + expectedDisplayTime - performance.now();
    onFrame({ ...captureFrame(video, mediaTime, needsImage()), shownAt });
  };
  video.requestVideoFrameCallback(shown);
}

/**
 * Call back when the displayed frame is certainly from after a seek. A busy browser may fire `seeked` before the
 * displayed frame changes, so the first frame reported after it may still be from before the seek.
 *
 * @param {HTMLVideoElement} video that has just fired `seeked`
 * @param {() => void} callback
 */
export function afterSeek(video, callback) {
  if (video.paused || !('requestVideoFrameCallback' in video)) return callback();
  let waiting = true;
  const finish = () => {
    if (waiting) callback();
    waiting = false;
  };
  // A hidden page gets no frame callbacks; on a visible page a missing callback means that the old frame is displayed.
  const timeout = () => (document.hidden ? finish() : setTimeout(finish, SEEK_TIMEOUT_VISIBLE_MS - SEEK_TIMEOUT_MS));
  setTimeout(timeout, SEEK_TIMEOUT_MS);
  video.requestVideoFrameCallback(() => video.requestVideoFrameCallback(finish));
}

/**
 * @param {HTMLVideoElement} video
 * @param {number} mediaTime of the frame reported last, seconds
 * @param {boolean} needsImage
 * @returns {{mediaTime: number, image: VideoFrame | null}}
 */
export function captureFrame(video, mediaTime, needsImage) {
  if (!needsImage || !globalThis.VideoFrame || video.readyState < HTMLMediaElement.HAVE_CURRENT_DATA) {
    return { mediaTime, image: null };
  }
  try {
    const image = new VideoFrame(video);
    const time = image.timestamp / 1e6;
    if (Math.abs(time - mediaTime) < SAME_TIMELINE_S) return { mediaTime: time, image };
    image.close();
  } catch {
    // No frame is available yet.
  }
  return { mediaTime, image: null };
}

/**
 * @param {HTMLVideoElement} video
 * @param {() => boolean} needsImage
 * @param {(frame: Frame) => void} onFrame
 * @param {AbortSignal} [signal]
 */
function pollFrames(video, needsImage, onFrame, signal) {
  let last = -1;
  const poll = () => {
    if (signal?.aborted) return;
    requestAnimationFrame(poll);
    if (video.currentTime === last || video.readyState < HTMLMediaElement.HAVE_CURRENT_DATA) return;
    last = video.currentTime;
    onFrame({ ...captureFrame(video, last, needsImage()), shownAt: Date.now() });
  };
  requestAnimationFrame(poll);
}
