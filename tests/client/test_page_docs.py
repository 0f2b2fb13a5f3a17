"""docs/how-to/watch.md names every button of the page, and every key."""

from __future__ import annotations

import re

import pytest

from fakes.paths import ROOT

PAGE = (ROOT / "client/page/index.html").read_text(encoding="utf-8")
DOCS = (ROOT / "docs/how-to/watch.md").read_text(encoding="utf-8")
KEYS = {"Space": "space"}


@pytest.mark.parametrize("key", re.findall(r'aria-keyshortcuts="([^"]+)"', PAGE))
def test_every_key_is_described(key: str) -> None:
    named = [cell for line in DOCS.splitlines() if line.startswith("| ") for cell in line.split("|")[2:3]]
    assert KEYS.get(key, key.upper() if len(key) == 1 else key) in " ".join(named).split()


@pytest.mark.parametrize("text", re.findall(r"<button[^>]*>([^<]+)<", PAGE))
def test_every_button_is_described(text: str) -> None:
    assert text in DOCS
