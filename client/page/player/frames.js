/**
 * Tells of every frame as it is shown: which one, and when; and takes it, to be painted with its boxes.
 *
 * requestVideoFrameCallback knows the very frame, but the browser may already show the next one by the
 * time a canvas over it is painted: boxes would be a frame late now and then. A VideoFrame carries its
 * own time, so a picture painted from it and the boxes of that time always belong together. Where a
 * browser lacks one or the other, the next best is used: right to a frame or so.
 */

const SAME_PLAYBACK_S = 0.5; // a VideoFrame whose time is further off than this counts time otherwise
const ARRIVING_MS = 1000; // for two frames to be shown after a seek
const ARRIVING_BUSY_MS = 5000; // likewise, by a visible page of a browser with much else to do

/**
 * @typedef {object} Frame
 * @property {number} mediaTime seconds
 * @property {number} shownAt milliseconds as of Date.now()
 * @property {VideoFrame | null} image to be closed by who asked for it
 */

/**
 * @param {HTMLVideoElement} video
 * @param {() => boolean} wanted whether the image is
 * @param {(frame: Frame) => void} tell
 * @param {AbortSignal} [enough] after which nothing is told
 */
export function watchFrames(video, wanted, tell, enough) {
  if (!('requestVideoFrameCallback' in video)) return watchTime(video, wanted, tell, enough);
  /** @type {VideoFrameRequestCallback} */
  const shown = (_now, { mediaTime, expectedDisplayTime }) => {
    if (enough?.aborted) return;
    video.requestVideoFrameCallback(shown);
    const shownAt = Date.now() + expectedDisplayTime - performance.now();
    tell({ ...take(video, mediaTime, wanted()), shownAt });
  };
  video.requestVideoFrameCallback(shown);
}

/**
 * Says when the picture is surely of what a seek has led to. A busy browser says that it has arrived a moment before
 * the picture changes, and of the first frame that it tells of then it cannot be said which side it is from.
 *
 * @param {HTMLVideoElement} video that says so just now
 * @param {() => void} then
 */
export function arrived(video, then) {
  if (video.paused || !('requestVideoFrameCallback' in video)) return then();
  let waits = true;
  const end = () => {
    if (waits) then();
    waits = false;
  };
  // A hidden page is told of no frame; a visible one that is late has no new picture yet.
  setTimeout(() => (document.hidden ? end() : setTimeout(end, ARRIVING_BUSY_MS - ARRIVING_MS)), ARRIVING_MS);
  video.requestVideoFrameCallback(() => video.requestVideoFrameCallback(end));
}

/**
 * @param {HTMLVideoElement} video
 * @param {number} mediaTime of the frame that was last told of, seconds
 * @param {boolean} wanted
 * @returns {{mediaTime: number, image: VideoFrame | null}}
 */
export function take(video, mediaTime, wanted) {
  if (!wanted || !globalThis.VideoFrame || video.readyState < HTMLMediaElement.HAVE_CURRENT_DATA) {
    return { mediaTime, image: null };
  }
  try {
    const image = new VideoFrame(video);
    const time = image.timestamp / 1e6;
    if (Math.abs(time - mediaTime) < SAME_PLAYBACK_S) return { mediaTime: time, image };
    image.close();
  } catch {
    // No picture to take yet.
  }
  return { mediaTime, image: null };
}

/**
 * @param {HTMLVideoElement} video
 * @param {() => boolean} wanted
 * @param {(frame: Frame) => void} tell
 * @param {AbortSignal} [enough]
 */
function watchTime(video, wanted, tell, enough) {
  let last = -1;
  const look = () => {
    if (enough?.aborted) return;
    requestAnimationFrame(look);
    if (video.currentTime === last || video.readyState < HTMLMediaElement.HAVE_CURRENT_DATA) return;
    last = video.currentTime;
    tell({ ...take(video, last, wanted()), shownAt: Date.now() });
  };
  requestAnimationFrame(look);
}
