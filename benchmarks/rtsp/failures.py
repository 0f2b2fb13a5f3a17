"""What a client of the gateway sees while a process of the site dies and is started again."""

from __future__ import annotations

import asyncio
import os
import signal
import threading
import time
from collections.abc import Sequence
from itertools import pairwise

import av

from benchmarks.rtsp.site import GatewaySite

_BEFORE_S, _AFTER_S, _WITHIN_S = 4.0, 20.0, 150.0
"""Seconds to watch before a death, and after frames have come again, for which so many seconds are waited."""
_SETTLED_S = 2.0
"""Until then frames may come that were sent before."""
_AGAIN_S = 120.0


class Watcher:
    """A client that counts frames until it is stopped or its stream ends."""

    def __init__(self, url: str) -> None:
        self.arrivals: list[float] = []
        self.error = ""
        self._stopped = False
        self._thread = threading.Thread(target=self._run, args=(url,), daemon=True)
        self._thread.start()

    def _run(self, url: str) -> None:
        try:
            with av.open(url, options={"rtsp_transport": "tcp"}, timeout=_AGAIN_S) as container:
                for _ in container.decode(video=0):
                    self.arrivals.append(time.monotonic())
                    if self._stopped:
                        return
            self.error = "the stream ends"
        except av.FFmpegError as error:
            self.error = str(error.strerror)

    @property
    def is_watching(self) -> bool:
        """Whether its connection stands."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """End it with the next frame."""
        self._stopped = True


async def watch_failures(site: GatewaySite) -> Sequence[Sequence[str]]:
    """Kill a camera, the service and the gateway in turn; return the rows of a table."""
    return [
        await _watch(site, name, command, path)
        for name, command, path in (
            ("the camera that is watched", "c1", "/cameras/c1"),
            ("a camera, best view watched", "c0", "/objects/1"),
            ("the best-view service", "bestview", "/cameras/c1"),
            ("the gateway", "rtsp", "/cameras/c1"),
        )
    ]


async def _watch(site: GatewaySite, name: str, command: str, path: str) -> Sequence[str]:
    watcher = await _watching(site.rtsp(path))
    await asyncio.sleep(_BEFORE_S)
    os.kill(site.child(command), signal.SIGKILL)
    killed = time.monotonic()
    while watcher.is_watching and time.monotonic() < killed + _WITHIN_S:
        if watcher.arrivals[-1] > killed + _SETTLED_S:
            await asyncio.sleep(_AFTER_S)
            break
        await asyncio.sleep(0.2)
    watcher.stop()
    arrivals = list(watcher.arrivals)
    told = "goes on" if watcher.is_watching or not watcher.error else watcher.error
    if told != "goes on":
        again = await _watching(site.rtsp(path))
        told += f"; plays again when it connects after {again.arrivals[0] - killed:.1f} s"
        again.stop()
    pause = max((late - early for early, late in pairwise(arrivals)), default=0.0)
    after = sum(arrival > killed + _SETTLED_S for arrival in arrivals)
    return name, f"{pause:.1f}", str(after), told


async def _watching(url: str) -> Watcher:
    """Return a client that has got a frame; it tries again while the gateway is away."""
    until = time.monotonic() + _AGAIN_S
    watcher = Watcher(url)
    while not watcher.arrivals:
        if not watcher.is_watching:
            if time.monotonic() > until:
                raise TimeoutError(watcher.error)
            watcher = Watcher(url)
        await asyncio.sleep(0.1)
    return watcher
