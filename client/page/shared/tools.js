/** What a viewer can take along: the picture, the link, the video in a window of its own. */

const QUALITY = 0.92; // of JPEG

/**
 * Save the picture now shown, as the camera sent it.
 *
 * @param {HTMLVideoElement} video
 * @param {string} name of the file, without its ending
 */
export async function saveSnapshot(video, name) {
  const canvas = new OffscreenCanvas(video.videoWidth, video.videoHeight);
  canvas.getContext('2d')?.drawImage(video, 0, 0);
  const link = document.createElement('a');
  link.href = URL.createObjectURL(await canvas.convertToBlob({ type: 'image/jpeg', quality: QUALITY }));
  link.download = `${name}.jpg`;
  link.click();
  URL.revokeObjectURL(link.href);
}

/**
 * @param {string} text to the clipboard
 * @returns {Promise<boolean>} whether the browser allowed it: some only on a page that came encrypted
 */
export async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    return copyBySelection(text);
  }
}

/** @param {string} text */
function copyBySelection(text) {
  const field = document.createElement('textarea');
  field.value = text;
  field.className = 'out-of-sight';
  document.body.append(field);
  field.select();
  const done = document.execCommand('copy');
  field.remove();
  return done;
}

/** @param {HTMLVideoElement} video out of the page and back */
export async function pictureInPicture(video) {
  if (document.pictureInPictureElement) await document.exitPictureInPicture();
  else await video.requestPictureInPicture();
}
