"""SIGHUP while a process starts: changes of its configuration until then are read."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from fakes.cli.command_line import RunCommand
from fakes.timeouts import PATIENCE
from server.cli import site_commands
from server.cli.generated_config import free_port
from server.supervisor.sighup import record_early_sighups, sighups


@pytest.fixture(autouse=True)
def _ignore_sighup() -> Iterator[None]:
    before = signal.signal(signal.SIGHUP, lambda *_: None)
    yield
    signal.signal(signal.SIGHUP, before)


def send_sighup() -> None:
    os.kill(os.getpid(), signal.SIGHUP)


async def wait_for_sighup() -> None:
    """Wait for SIGHUP."""
    waiting = sighups()
    async with asyncio.timeout(PATIENCE):
        await anext(waiting)
    await waiting.aclose()


@pytest.mark.parametrize("command", [("sync",), ("camera", "c0"), ("bestview",), ("up",)])
def test_a_sighup_between_reading_and_running_is_not_lost(
    myview: RunCommand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    bus = f"tcp/127.0.0.1:{free_port()}"
    content = {
        "cameras": [{"id": "c0", "source": "scene:room"}],
        "sync": {"port": free_port()},
        "zenoh": {"connect": bus, "listen": bus},
        "http": {"port": 0},
    }
    path = tmp_path / "site.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    reloaded: list[str] = []

    def run(_: Callable[[], Coroutine[Any, Any, None]], **__: float) -> None:
        send_sighup()
        asyncio.run(wait_for_sighup())
        reloaded.append("to read it again")

    monkeypatch.setattr(site_commands, "run_process", run)
    result = myview(command[0], path, *command[1:])
    assert (result.code, result.err) == (0, "")
    assert reloaded == ["to read it again"]


async def test_early_sighups_count_as_one_and_later_ones_separately() -> None:
    record_early_sighups()
    send_sighup()
    send_sighup()
    waiting = sighups()
    async with asyncio.timeout(PATIENCE):
        await anext(waiting)
        second_wait = asyncio.ensure_future(anext(waiting))
        await asyncio.sleep(0)
        assert not second_wait.done(), "early signals are merged into one"
        send_sighup()
        await second_wait
    await waiting.aclose()
