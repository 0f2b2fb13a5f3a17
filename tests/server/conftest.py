"""What the server's tests share."""

from __future__ import annotations

import os

import pytest

from fakes.cli.command_line import myview
from fakes.service.fed_site import busy, hall
from fakes.service.vp8_site import free

__all__ = ["busy", "free", "hall", "myview"]


@pytest.fixture(autouse=True)
def _no_settings_from_outside(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in os.environ if name.startswith("MYVIEW_") and "__" in name]:
        monkeypatch.delenv(name)
