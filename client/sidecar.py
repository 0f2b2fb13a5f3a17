"""Sidecar files with the boxes of a recorded film: metadata (WebVTT), and drawn subtitles (ASS)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import msgspec

from client.model import Box, Site
from client.stream_events import Frame

_ASS_HEAD = """[Script Info]
ScriptType: v4.00+
PlayResX: {width}
PlayResY: {height}
ScaledBorderAndShadow: yes

[V4+ Styles]
Format: Name, Fontname, Fontsize, PrimaryColour, SecondaryColour, OutlineColour, BackColour, Bold, Italic, \
Underline, StrikeOut, ScaleX, ScaleY, Spacing, Angle, BorderStyle, Outline, Shadow, Alignment, MarginL, \
MarginR, MarginV, Encoding
Style: Shown,Sans,{size},&HFF000000,&HFF000000,&H0000E5FF,&HFF000000,0,0,0,0,100,100,0,0,1,1.5,0,7,0,0,0,1
Style: Other,Sans,{size},&HFF000000,&HFF000000,&H00B0B0B0,&HFF000000,0,0,0,0,100,100,0,0,1,1,0,7,0,0,0,1
Style: Name,Sans,{size},&H00FFFFFF,&H00FFFFFF,&H00000000,&HFF000000,0,0,0,0,100,100,0,0,1,1,0,1,0,0,0,1

[Events]
Format: Layer, Start, End, Style, Name, MarginL, MarginR, MarginV, Effect, Text
"""


def sidecars(film: Path) -> tuple[Path, Path]:
    """Return the paths of a film's sidecar files: WebVTT, ASS."""
    return film.with_suffix(".vtt"), film.with_suffix(".ass")


def write_sidecars(film: Path, frames: Iterable[Frame], first: int, number: int, site: Site) -> None:
    """Write the boxes of a film of object ``number`` whose time 0 is pulse ``first``.

    ``frames`` is consumed one by one: a film may last a day.

    Raises:
        OSError: they cannot be written; both files, also earlier ones, are then removed.
    """
    try:
        _write(film, frames, first, number, site)
    except OSError:
        for path in sidecars(film):
            with suppress(OSError):
                path.unlink(missing_ok=True)
        raise


def _write(film: Path, frames: Iterable[Frame], first: int, number: int, site: Site) -> None:
    with ExitStack() as files:
        vtt, ass = (
            files.enter_context(path.open("w", encoding="utf-8", newline="\n")) for path in sidecars(film)
        )
        vtt.write(_vtt_head(number, site))
        ass.write(_ASS_HEAD.format(width=site.width, height=site.height, size=max(8, site.height // 24)))
        between = ""
        for frame in frames:
            vtt.write(f"\n\n{_cue(frame, first, site)}")
            for line in _lines(frame, first, number, site):
                ass.write(f"{between}Dialogue: {line}")
                between = "\n"
        vtt.write("\n")
        ass.write("\n")


def _vtt_head(number: int, site: Site) -> str:
    return (
        f"WEBVTT\n\nNOTE the best view of object {number} of {site.name}; boxes: object, left, top, right, "
        f"bottom in pixels of a picture of {site.width}x{site.height}"
    )


def _cue(frame: Frame, first: int, site: Site) -> str:
    """Return a frame's cue: its pulse as the identifier, JSON as the text (W3C WebVTT)."""
    times = " --> ".join(_clock((at - first) / site.fps, 3) for at in (frame.pulse, frame.pulse + 1))
    text = {"camera": frame.camera, "boxes": [_rounded(box) for box in frame.boxes]}
    return f"p{frame.pulse}\n{times}\n{msgspec.json.encode(text).decode()}"


def _rounded(box: Box) -> Box:
    """Return a box rounded to a tenth of a pixel, which is finer than any detector."""
    return Box(box.object, *(round(side, 1) for side in (box.left, box.top, box.right, box.bottom)))


def _lines(frame: Frame, first: int, number: int, site: Site) -> Iterator[str]:
    """Yield the subtitles that draw a frame's boxes (Advanced SubStation Alpha, for libass)."""
    begin, end = (_clock((at - first) / site.fps, 2) for at in (frame.pulse, frame.pulse + 1))
    for box in frame.boxes:
        yield from _drawn(box, begin, end, "Shown" if box.object == number else "Other")


def _drawn(box: Box, begin: str, end: str, style: str) -> tuple[str, str]:
    left, top, right, bottom = (round(side) for side in (box.left, box.top, box.right, box.bottom))
    shape = f"m {left} {top} l {right} {top} {right} {bottom} {left} {bottom}"
    return (
        f"0,{begin},{end},{style},,0,0,0,,{{\\pos(0,0)\\p1}}{shape}",
        f"1,{begin},{end},Name,,0,0,0,,{{\\pos({left},{top - 2})}}{box.object}",
    )


def _clock(seconds: float, decimals: int) -> str:
    """Format a time as ``hh:mm:ss`` with the given decimals."""
    units = round(seconds * 10**decimals)
    whole, part = divmod(units, 10**decimals)
    minutes, second = divmod(whole, 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours:02}:{minute:02}:{second:02}.{part:0{decimals}}"
