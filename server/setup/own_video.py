"""Whether a camera's own video could be sent on as it is, and how the camera must be set for that."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from server.config.sections import EncodeSettings
from server.media.codec import nal_codec
from server.setup.proposal import SiteProposal
from server.setup.trial_messages import StreamTrial

_SAME_RATE = 0.03
"""Relative deviation of a camera's rate, which is measured."""
_CODECS = ("h264", "h265")
_PASSED = "its own video fits, and is sent on as it is: that spares the encoding"
_FITS = "with encode.parameters: own, its own video is sent on, which spares the encoding"
_MISFITS = "sends its own video on, which spares the encoding, once the camera is set to:"
_WANTED = (
    r"H\.26[45]|\d+x\d+ pixels|[\d.]+ frames a second|no B frames"
    r"|a fixed GOP \(I-frame interval\) of \d+ frames(?:, not \d+)?"
)
_LINES = re.compile(
    rf"^( *)(#?)passthrough: auto +# (?:{re.escape(_PASSED)}|{re.escape(_FITS)}|{re.escape(_MISFITS)}"
    rf"(?:\n *# (?:{_WANTED})(?:; (?:{_WANTED}))*)?)(?:\n|\Z)",
    re.MULTILINE,
)
"""The lines of :func:`passthrough_lines`."""


@dataclass(frozen=True, slots=True)
class OwnVideo:
    """What is known of passing a camera's own video through.

    Attributes:
        fits: whether it fits as it is.
        wanted: settings of the camera with which it would; empty: it fits, or no setting of the camera helps.
    """

    fits: bool = False
    wanted: str = ""


NOT_COMPARED = OwnVideo()
_DEFAULT_ENCODE = EncodeSettings()


def compare_own_video(
    trial: StreamTrial, site: SiteProposal, encode: EncodeSettings = _DEFAULT_ENCODE
) -> OwnVideo:
    """Compare what a camera sends with the streams of a site."""
    if trial.codec not in {"h264", "hevc"} or encode.codec not in _CODECS or not trial.is_upright:
        return NOT_COMPARED
    codec, size, rate, gop, order = _wanted_settings(site, encode)
    wanted = []
    if trial.codec != nal_codec(encode.codec).ffmpeg_name:
        wanted.append(codec)
    if (trial.width, trial.height) != (site.width, site.height):
        wanted.append(size)
    if not trial.fps or abs(trial.fps / site.fps - 1) > _SAME_RATE:
        wanted.append(rate)
    if trial.gop != encode.frames_per_gop(site.fps):
        wanted.append(gop + (f", not {trial.gop}" * bool(trial.gop)))
    if trial.reorders:
        wanted.append(order)
    return OwnVideo(not wanted, "; ".join(wanted))


def unknown_own_video(site: SiteProposal, encode: EncodeSettings) -> OwnVideo:
    """Return what can be said of a camera that sends nobody knows what: all that it must be set to."""
    if encode.codec not in _CODECS:
        return NOT_COMPARED
    return OwnVideo(wanted="; ".join(_wanted_settings(site, encode)))


def _wanted_settings(site: SiteProposal, encode: EncodeSettings) -> Sequence[str]:
    """Return codec, size, rate, GOP and order that a camera must be set to."""
    return (
        nal_codec(encode.codec).title,
        f"{site.width}x{site.height} pixels",
        f"{site.fps:g} frames a second",
        f"a fixed GOP (I-frame interval) of {encode.frames_per_gop(site.fps)} frames",
        "no B frames",
    )


def passthrough_lines(
    own_video: OwnVideo, indent: str = "    ", *, is_set: bool, has_own_parameters: bool = True
) -> str:
    """Return what a configuration says of passing a camera's own video through.

    Args:
        own_video: the camera's.
        indent: of the camera's settings.
        is_set: whether it is passed through where it can be; otherwise the line is only a comment.
        has_own_parameters: whether each camera may have parameter sets of its own.
    """
    line = f"{indent}{'' if is_set else '#'}passthrough: auto"
    if own_video.fits:
        return f"{line}  # {_PASSED if is_set and has_own_parameters else _FITS}\n"
    if own_video.wanted:
        return f"{line}  # {_MISFITS}\n{indent}# {own_video.wanted}\n"
    return f"{line}\n" if is_set else ""


def with_passthrough_lines(text: str, own_video: OwnVideo, *, has_own_parameters: bool) -> str:
    """Return a text in which the lines that :func:`passthrough_lines` has made are true of another stream."""

    def lines(match: re.Match[str]) -> str:
        return passthrough_lines(
            own_video, match[1], is_set=not match[2], has_own_parameters=has_own_parameters
        )

    return _LINES.sub(lines, text)
