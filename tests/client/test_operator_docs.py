"""docs/how-to/operate.md names every section and every button of the operator's page."""

from __future__ import annotations

import re

import pytest

from fakes.paths import ROOT

PAGE = (ROOT / "client/page/operator.html").read_text(encoding="utf-8")
DOCS = (ROOT / "docs/how-to/operate.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("text", re.findall(r"<(?:button|a) [^>]*>([^<]+)<", PAGE))
def test_every_section_and_button_is_described(text: str) -> None:
    assert f"**{text}**" in DOCS or f"\n## {text}\n" in DOCS
