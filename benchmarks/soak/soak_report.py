"""The report of a soak test: tables and curves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from benchmarks.common.report import Report
from benchmarks.soak.measurements import SoakMeasurements
from benchmarks.soak.samples import DELAY, RESIDENT, GrowthRule, GrowthVerdict, ProcessSample, judge

_DISK = GrowthRule("recorded, MB", 0.05, 1.0)
_MIN_SAMPLES = 8
"""Samples at least: two in each quarter."""
_NAMED = 5
"""Numbers of a table's row."""

_CURVES: tuple[tuple[str, Callable[[ProcessSample], float]], ...] = (
    ("resident memory, MB", lambda sample: sample.resident),
    ("descriptors", lambda sample: sample.descriptors),
    ("threads", lambda sample: sample.threads),
    ("tasks of the event loop", lambda sample: sample.tasks),
    ("Python's memory blocks, thousands", lambda sample: sample.blocks / 1e3),
)


def verdicts(measurements: SoakMeasurements) -> list[tuple[str, GrowthVerdict]]:
    """Check the growth of all measurements."""
    found = [(name, verdict) for name, samples in measurements.samples.items() for verdict in judge(samples)]
    hours = [delay.hours for delay in measurements.delays]
    for name, values in (
        ("viewer of a camera", [delay.camera for delay in measurements.delays]),
        ("viewer of a person", [delay.person for delay in measurements.delays]),
    ):
        there = [place for place, value in enumerate(values) if np.isfinite(value)]
        found.append(
            (name, DELAY.judge([hours[place] for place in there], [values[place] for place in there]))
        )
    return [*found, ("recording", _DISK.judge(hours, measurements.recorded))]


def describe(report: Report, measurements: SoakMeasurements) -> bool:
    """Print the tables; return whether everything stayed flat and no fault occurred."""
    time_scale, visitors = measurements.time_scale, measurements.visitors
    hours = measurements.delays[-1].hours if measurements.delays else 0.0
    report.line(
        f"{hours:.2f} hours of the site in {measurements.seconds / 60:.1f} minutes:"
        f" {time_scale.fps:g} pulses a second, {visitors.camera.pulse} frames of each camera"
    )
    passed = not measurements.failure
    if len(measurements.delays) >= _MIN_SAMPLES:
        growth = verdicts(measurements)
        report.table(
            "second and fourth quarter of the time: medians, for the delay the best tenth",
            ["of", "second", "fourth", "change", "quantity", "flat"],
            [
                [
                    who,
                    f"{verdict.second:.1f}",
                    f"{verdict.fourth:.1f}",
                    f"{100 * (verdict.fourth / verdict.second - 1):+.1f} %" if verdict.second else "+0.0 %",
                    verdict.rule.name,
                    "yes" if verdict.flat else "NO",
                ]
                for who, verdict in growth
            ],
        )
        passed &= all(verdict.flat for _, verdict in growth)
    else:
        passed = False
        report.line("too few samples to compare the quarters")
    missing_frames = {
        "of a camera": visitors.camera.missing_frames,
        "of a person": visitors.person.missing_frames,
    }
    counts = measurements.counts
    searched = {
        name: f"{camera['shed'] + camera['missed']} of {camera['frames']}"
        for name, camera in counts.cameras.items()
    }
    report.line(f"visits: {_join_counts(dict(sorted(visitors.visits.items())))}")
    report.line(
        f"events received: {visitors.events}; frames missing in a stream: {_join_counts(missing_frames)}"
    )
    report.line(f"frames missed or not searched: {_join_counts(searched)}")
    report.line(f"windows late: {counts.late}")
    faults = ", ".join(f"{what} ({count})" for what, count in sorted(visitors.faults.items())) or "none"
    report.line(f"faults of visitors: {faults}")
    if measurements.failure:
        report.line(f"BROKEN: {measurements.failure}")
    passed &= not any(missing_frames.values()) and not visitors.faults
    report.line("flat: " + ("yes" if passed else "NO"))
    return passed


def plot(measurements: SoakMeasurements, path: Path) -> None:
    """Draw the curves over the site's time."""
    figure = Figure(figsize=(10, 17))
    axes = figure.subplots(len(_CURVES) + 2, 1, sharex=True)
    for axis, (name, value) in zip(axes, _CURVES, strict=False):
        for process, samples in measurements.samples.items():
            axis.plot(
                [sample.hours for sample in samples],
                [value(sample) for sample in samples],
                label=process,
                linewidth=1,
            )
        axis.set(ylabel=name, ylim=(0, None))
    hours = [delay.hours for delay in measurements.delays]
    axes[0].set_title(f"{hours[-1]:.1f} hours of a site, {measurements.time_scale.speed:g} times as fast")
    axes[0].legend(ncols=_NAMED, fontsize="small")
    delay = axes[len(_CURVES)]
    _line(delay, hours, [delay.camera for delay in measurements.delays], "of a camera")
    _line(delay, hours, [delay.person for delay in measurements.delays], "of a person")
    delay.set(ylabel="delay to a viewer, ms", yscale="log")
    delay.legend(fontsize="small")
    axes[-1].plot(hours, measurements.recorded, linewidth=1)
    axes[-1].set(ylabel=_DISK.name, ylim=(0, None), xlabel=f"hours of the site; memory may grow {_share()}")
    for axis in axes:
        axis.grid(alpha=0.3)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)


def _join_counts(counts: Mapping[str, object]) -> str:
    return ", ".join(f"{what} {count}" for what, count in counts.items())


def _share() -> str:
    return f"by {100 * RESIDENT.share:.0f} % from the second quarter to the fourth"


def _line(axis: object, hours: Sequence[float], values: Sequence[float], label: str) -> None:
    axis.plot(hours, values, label=label, linewidth=1)  # type: ignore[attr-defined]
