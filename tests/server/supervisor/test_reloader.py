"""A best-view service reloads the configuration by itself, or has its supervisor do so."""

from __future__ import annotations

import os
import signal

import pytest

from server.config.running_config import ACTIVE_CONFIG_VARIABLE
from server.supervisor.bestview_process import reloader


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    sent: list[tuple[int, int]] = []
    monkeypatch.setattr(os, "kill", lambda process, number: sent.append((process, number)))
    return sent


def test_a_process_of_its_own_reloads_itself(
    sent: list[tuple[int, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(ACTIVE_CONFIG_VARIABLE, raising=False)
    reloader()()
    assert sent == [(os.getpid(), signal.SIGHUP)]


def test_under_up_the_supervisor_reloads_unless_it_has_died(
    sent: list[tuple[int, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(ACTIVE_CONFIG_VARIABLE, "site.yaml")
    monkeypatch.setattr(os, "getppid", lambda: 4711)
    reload = reloader()
    reload()
    assert sent == [(4711, signal.SIGHUP)]
    monkeypatch.setattr(os, "getppid", lambda: 1)
    reload()
    assert sent == [(4711, signal.SIGHUP)]
