"""The site's name, rate and size are changed in a configuration; comments and other settings stay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from server.config.loader import load_config
from server.setup.site_settings import StreamFormatChoice, read_choice, save_choice
from server.system.errors import UserError

CAMERAS = "cameras: [{id: c0, source: 'scene:room'}]\n"
TEXT = f"""\
# mine
site:  # of the shop
  name: hall
  fps: 12.5  # a slower camera repeats pictures
  # every picture is fitted
  width: 320   # into this size
  niceness: 5
{CAMERAS}"""
HALL = StreamFormatChoice("hall", 12.5, 320, 360)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "site.yaml"
    path.write_text(TEXT)
    return path


def test_only_what_changes_is_written_and_comments_stay(path: Path) -> None:
    assert read_choice(path) == HALL
    save_choice(path, HALL)
    assert list(path.parent.iterdir()) == [path]
    save_choice(path, replace(HALL, fps=25.0, width=640))
    assert path.read_text() == TEXT.replace("12.5", "25").replace("320", "640")
    assert [file.read_text() for file in path.parent.glob("site.2*.yaml")] == [TEXT]
    save_choice(path, replace(HALL, name="shop", fps=25.0, width=640, height=480))
    config = load_config(path)
    assert (config.site.name, config.site.size, config.site.niceness) == ("shop", (640, 480), 5)
    assert path.read_text().startswith("# mine\n")
    assert path.read_text().endswith(CAMERAS)


@pytest.mark.parametrize("site", ["", "site: {name: hall, width: 320}\n", "site:\n  name: hall\n"])
def test_a_section_in_any_style_is_changed(path: Path, site: str) -> None:
    path.write_text(f"{site}{CAMERAS}")
    save_choice(path, StreamFormatChoice("shop", 10.0, 640, 480))
    assert read_choice(path) == StreamFormatChoice("shop", 10.0, 640, 480)


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"name": "../x"}, "site: name: a name has letters"),
        ({"width": 321}, "site: width: must be even"),
        ({"height": 0}, "site: height: "),
        ({"fps": float("nan")}, "site: fps: "),
        ({"fps": -1.0}, "site: fps: Input should be greater than or equal to"),
    ],
)
def test_what_is_invalid_is_one_line_and_changes_nothing(
    path: Path, change: dict[str, Any], error: str
) -> None:
    with pytest.raises(UserError) as refused:
        save_choice(path, replace(HALL, **change))
    assert error in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1
    assert path.read_text() == TEXT
