"""Screenshots as files of the documents: sizes of the windows, scaling, WebP."""

from __future__ import annotations

import argparse
import io
from pathlib import Path

from PIL import Image

from benchmarks.common.environment import ROOT

WIDTHS = {360: 740, 800: 900, 1600: 900}
"""Sizes of the window."""
_WIDEST = 1000
"""Largest width of a picture in the documents, pixels; wider ones are scaled down."""
_QUALITY = 55


def write_webp(png: bytes, path: Path) -> None:
    """Write a screenshot."""
    image = Image.open(io.BytesIO(png)).convert("RGB")
    if image.width > _WIDEST:
        size = (_WIDEST, round(image.height * _WIDEST / image.width))
        image = image.resize(size, Image.Resampling.LANCZOS)
    path.parent.mkdir(parents=True, exist_ok=True)
    image.save(path, "WEBP", quality=_QUALITY, method=6)


def options_of(module: str, about: str) -> argparse.ArgumentParser:
    """Return the options of a module that takes screenshots; `about`: its docstring."""
    options = argparse.ArgumentParser(
        prog=f"python -m benchmarks.screenshots.{module}", description=about.splitlines()[0]
    )
    options.add_argument(
        "--out", type=Path, default=ROOT / "docs" / "screenshots", help="folder to write into"
    )
    return options
