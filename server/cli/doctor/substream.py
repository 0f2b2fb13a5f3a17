"""Check of a camera's substream: whether it opens, and shows what its source shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from server.cli.doctor.findings import Finding, ok, warning
from server.cli.doctor.stream_probe import StreamStats, measure_stream
from server.config.sections import CameraSettings
from server.config.source_address import SourceKind, source_kind
from server.system.errors import UserError

_FILE_S = 0.2
"""Seconds for which a recording is decoded."""
_SAME_SHAPE = 0.03
_SAME_RATE = 0.1
"""Relative differences that are not reported."""
_SAME_VIEW = 0.5
"""Correlation of the mean pictures of one view, at least."""
_LEAST_CONTRAST = 4.0
"""Gray levels below which a picture shows nothing to compare."""


@dataclass(frozen=True, slots=True)
class SubstreamProbe:
    """The result of a probe.

    Attributes:
        problem: why it cannot be used; empty: it can.
        source: statistics of the source.
        substream: statistics of the substream; None: there is a problem.
    """

    problem: str
    source: StreamStats | None = None
    substream: StreamStats | None = None


def probe_substream(
    camera: CameraSettings, source: StreamStats | None, seconds: float, open_s: float
) -> SubstreamProbe | None:
    """Probe a camera's substream for some seconds; None: it has none.

    Args:
        camera: the camera, with its password filled in.
        source: statistics of its source, if that is a network camera.
        seconds: to measure.
        open_s: timeout for opening it.
    """
    if camera.substream is None or source_kind(camera.substream) in {SourceKind.SCENE, SourceKind.FOLDER}:
        return None
    options: Mapping[str, str] = camera.options
    if source is None:
        options, seconds = {}, _FILE_S
        if source_kind(camera.source) is SourceKind.FILE:
            source = measure_stream(camera.source, options, seconds, open_s)
    try:
        return SubstreamProbe("", source, measure_stream(camera.substream, options, seconds, open_s))
    except UserError as error:
        return SubstreamProbe(str(error), source)


def substream_findings(check: str, probe: SubstreamProbe) -> list[Finding]:
    """Report on a substream: that it is right, or each thing that is not."""
    small, large = probe.substream, probe.source
    if small is None:
        remedy = "fix its address; people are tracked in the source meanwhile"
        return [warning(check, f"substream: {probe.problem}", remedy)]
    size = "x".join(map(str, small.size))
    rate = "" if small.fps is None else f", {small.fps:.1f} pictures a second"
    wrong = [] if large is None else _differences(small, large)
    if not wrong:
        return [ok(check, f"substream: {size} pixels{rate}")]
    return [warning(check, f"substream: {text}", remedy) for text, remedy in wrong]


def _differences(small: StreamStats, large: StreamStats) -> list[tuple[str, str]]:
    """Return what is wrong with a substream beside its source, each with a remedy."""
    wrong = []
    size, source_size = ("x".join(map(str, stats.size)) for stats in (small, large))
    if _correlation(small, large) < _SAME_VIEW:
        wrong.append(
            ("it shows another picture than the source", "enter the address of the same camera's stream")
        )
    shapes = [stats.shown_size[0] / stats.shown_size[1] for stats in (small, large)]
    if abs(shapes[0] / shapes[1] - 1) > _SAME_SHAPE:
        effect = (
            "it is stretched to that"
            if small.shown_size == small.size
            else "it counts as the middle of the source's picture"
        )
        wrong.append(
            (f"{size}, another shape than the source's {source_size}: {effect}", "set both to one shape")
        )
    if small.size[0] * small.size[1] >= large.size[0] * large.size[1]:
        wrong.append(
            (f"{size}, not smaller than the source's {source_size}", "exchange them, or leave it out")
        )
    if small.fps and large.fps and abs(small.fps / large.fps - 1) > _SAME_RATE:
        text = (
            f"{small.fps:.1f} pictures a second, the source has {large.fps:.1f}: boxes are up to "
            f"{500 / small.fps:.0f} ms apart from the picture"
        )
        wrong.append((text, "set both to one rate"))
    return wrong


def _correlation(one: StreamStats, other: StreamStats) -> float:
    """Return the correlation of the mean pictures, -1 to 1; 1 where one is plain or missing."""
    if one.picture is None or other.picture is None:
        return 1.0
    if min(one.picture.std(), other.picture.std()) < _LEAST_CONTRAST:
        return 1.0
    return float(np.corrcoef(one.picture.ravel(), other.picture.ravel())[0, 1])
