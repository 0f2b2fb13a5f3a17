/** Saving a snapshot, copying text, and picture-in-picture. */

const QUALITY = 0.92; // of JPEG

/**
 * Save the displayed frame as JPEG, without boxes.
 *
 * @param {HTMLVideoElement} video
 * @param {string} name of the file, without extension
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
 * Copy text to the clipboard.
 *
 * @param {string} text
 * @returns {Promise<boolean>} whether the browser allowed it; the clipboard API needs HTTPS
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
  field.className = 'off-screen';
  document.body.append(field);
  field.select();
  const copied = document.execCommand('copy');
  field.remove();
  return copied;
}

/**
 * Enter picture-in-picture, or leave it.
 *
 * @param {HTMLVideoElement} video
 */
export async function pictureInPicture(video) {
  if (document.pictureInPictureElement) await document.exitPictureInPicture();
  else await video.requestPictureInPicture();
}
