"""What the server's tests share."""

from __future__ import annotations

import os

import pytest

from fakes.cli.command_line import myview
from fakes.page.browser import browser
from fakes.service.fed_site import served, site_with_people
from fakes.service.vp8_site import vp8_site
from fakes.timeouts import PATIENCE
from server.setup import trial_messages

__all__ = ["browser", "myview", "served", "site_with_people", "vp8_site"]


@pytest.fixture(autouse=True)
def _no_settings_from_outside(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in os.environ if name.startswith("MYVIEW_") and "__" in name]:
        monkeypatch.delenv(name)


@pytest.fixture(autouse=True)
def _patience_with_trials(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial_messages, "TRIAL_S", PATIENCE)
