"""A site whose cameras are started and killed one by one."""

from __future__ import annotations

import contextlib
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import yaml

from benchmarks.common.started_processes import start_module, terminate
from server.cli.generated_config import free_port
from synthetic import Scene, write_recording

FPS = 25.0
WIDTH, HEIGHT = 352, 288
_FILMS = 4
"""Views of the room; further cameras repeat them."""
_PEOPLE, _SEED, _FILM_S = 4, 1, 40.0
_PATIENCE_S = 60.0
_POLL_S = 0.2
LOG = "site.log"
_COMMAND = "server.cli.main"


class GrowingSite:
    """A running site whose cameras the caller adds and kills."""

    def __init__(self, config: Path, url: str, log: IO[bytes]) -> None:
        self.url = url
        self._config, self._log = config, log
        self.cameras: dict[str, subprocess.Popen[bytes]] = {}

    def add(self) -> None:
        """Start one more camera."""
        name = f"c{len(self.cameras)}"
        self.cameras[name] = start_module(self._log, _COMMAND, "camera", str(self._config), name)

    def kill_all_but(self, count: int) -> None:
        """Kill all cameras but the first `count`."""
        removed = list(self.cameras)[count:]
        processes = [self.cameras.pop(camera) for camera in removed]
        for process in processes:
            process.kill()
        for process in processes:
            process.wait()


@contextlib.contextmanager
def run_growing_site(most: int, folder: Path) -> Iterator[GrowingSite]:
    """Run a site configured for `most` cameras, without starting any."""
    films = folder / "films"
    scene = Scene("room", _FILMS, _PEOPLE, _SEED, WIDTH, HEIGHT, FPS)
    write_recording(scene, films, _FILM_S)
    sync, bus, http = (free_port() for _ in range(3))
    address = f"tcp/127.0.0.1:{bus}"
    content = {
        "site": {"name": "load", "fps": FPS, "width": WIDTH, "height": HEIGHT},
        "sync": {"port": sync, "start_timeout_s": 1.0},
        "zenoh": {"connect": address, "listen": address},
        "http": {"port": http},
        "cameras": [
            {"id": f"c{number}", "source": str(films / f"c{number % _FILMS}.mp4"), "at_end": "loop"}
            for number in range(most)
        ],
    }
    config = folder / "site.yaml"
    config.write_text(yaml.safe_dump(content), encoding="utf-8")
    with (folder / LOG).open("wb") as log:
        started = [start_module(log, _COMMAND, name, str(config)) for name in ("bestview", "sync")]
        site = GrowingSite(config, f"http://127.0.0.1:{http}/", log)
        try:
            _wait_until_up(site.url)
            yield site
        finally:
            terminate([*site.cameras.values(), *started])


def _wait_until_up(url: str) -> None:
    give_up = time.monotonic() + _PATIENCE_S
    while time.monotonic() < give_up:
        with contextlib.suppress(urllib.error.URLError, ConnectionError):
            urllib.request.urlopen(f"{url}healthz", timeout=_PATIENCE_S).close()  # noqa: S310 — own address
            return
        time.sleep(_POLL_S)
    raise RuntimeError("the best-view service did not start")
