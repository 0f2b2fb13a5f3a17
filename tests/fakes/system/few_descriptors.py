"""A process with a low limit of open files, and connections to it."""

from __future__ import annotations

import shlex
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import yaml

from fakes.system.ports import free_port
from fakes.timeouts import PATIENCE

FEW_DESCRIPTORS = 64  # descriptors: hardly more than a process needs
MYVIEW = f"{shlex.quote(sys.executable)} -m server.cli.main"


def write_site(folder: Path, port: int) -> Path:
    path = folder / "site.yaml"
    content = {
        "site": {"name": "hall"},
        "cameras": [{"id": "c0", "source": "c0.mp4"}],
        "sync": {"port": port},
        "http": {"port": free_port()},
        "zenoh": dict.fromkeys(("connect", "listen"), f"tcp/127.0.0.1:{free_port()}"),
    }
    path.write_text(yaml.safe_dump(content))
    return path


@contextmanager
def running(command: str, log: Path, descriptors: int = FEW_DESCRIPTORS) -> Iterator[subprocess.Popen[bytes]]:
    """Run a command with few descriptors and its log in a file."""
    with (
        log.open("wb") as out,
        subprocess.Popen(f"ulimit -n {descriptors}; exec {command}", shell=True, stderr=out) as process,  # noqa: S602
    ):
        try:
            yield process
        finally:
            process.terminate()
            process.wait(PATIENCE)


def connect(port: int) -> socket.socket:
    """Connect as soon as the port is open."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            return socket.create_connection(("127.0.0.1", port), PATIENCE)
        except ConnectionRefusedError:
            assert time.monotonic() < end, "the port is closed"
            time.sleep(0.02)


def wait_for_log(log: Path, what: bytes) -> None:
    end = time.monotonic() + PATIENCE
    while what not in log.read_bytes():
        assert time.monotonic() < end, log.read_bytes()
        time.sleep(0.02)
