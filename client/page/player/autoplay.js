/** Lets a video go on, and tells when it was somebody else who did: the browser, its window of its own, a key. */

export class Going {
  #asked = false;

  /**
   * @param {HTMLVideoElement} video
   * @param {() => void} resumed
   */
  constructor(video, resumed) {
    this.video = video;
    video.addEventListener('play', () => {
      const asked = this.#asked;
      this.#asked = false;
      if (!asked) resumed();
    });
  }

  /** Let the picture go on, wherever it is. */
  on() {
    if (!this.video.paused) return;
    this.#asked = true;
    this.video.play().catch(() => (this.#asked = false)); // the page says that it is paused, and how to go on
  }
}
