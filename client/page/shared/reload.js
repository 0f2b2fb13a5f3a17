/**
 * Reloads a page whose script or style sheet could not be loaded, once the server answers.
 *
 * Browsers abort requests when the network changes, and load no module a second time: the page would stay empty.
 * A classic script before all others, since a module could fail itself.
 */
(() => {
  const AGAIN_MS = 3000;
  const FIRST_MS = 100;
  const TIMEOUT_MS = 4000;
  let failed = false;

  async function reloadWhenServed() {
    const [navigation] = performance.getEntriesByType('navigation');
    // A file that is missing for good must not make pages reload without a pause.
    let wait = /** @type {PerformanceNavigationTiming} */ (navigation).type === 'reload' ? AGAIN_MS : FIRST_MS;
    for (;;) {
      await new Promise((resolve) => setTimeout(resolve, wait));
      wait = AGAIN_MS;
      const { ok } = await fetch(location.href, {
        method: 'HEAD',
        cache: 'no-store',
        signal: AbortSignal.timeout(TIMEOUT_MS),
      }).catch(() => ({ ok: false }));
      if (ok) return location.reload();
    }
  }

  const onError = (/** @type {Event} */ { target }) => {
    const isNeeded = target instanceof HTMLScriptElement || target instanceof HTMLLinkElement;
    if (!isNeeded || failed) return;
    failed = true;
    void reloadWhenServed();
  };
  addEventListener('error', onError, true); // such errors do not bubble
})();
