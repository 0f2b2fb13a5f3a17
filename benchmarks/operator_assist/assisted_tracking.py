"""Live tracking of a clip, with or without a simulated operator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.operator_assist.clips import Clip
from benchmarks.operator_assist.flag_selection import FlagSelector
from benchmarks.operator_assist.identity_failures import IdentityFailure, failures
from benchmarks.operator_assist.simulated_operator import OperatorFlag, OperatorProfile, SimulatedOperator
from server.config.sections import FlagSettings
from tracking import CostSettings, WindowResult, WindowSettings, create_solver
from tracking.baselines.flag_states.tracker import FlagStatesTracker
from tracking.boxes import Floats
from tracking.interactive import CorrectableTracker, InteractiveSettings, PositionCorrection, RiskEvent
from tracking.solvers import DEFAULT_SOLVER

_ALL = FlagSettings(per_minute=600, risk=0.0)
_BATCH = 3
"""Frames whose corrections are sent together: a tenth of a second."""


@dataclass(frozen=True, slots=True)
class TrackingSetup:
    """The settings of a camera's tracker."""

    window: WindowSettings
    costs: CostSettings
    assist: InteractiveSettings


FISH = TrackingSetup(
    WindowSettings(
        max_height_ratio=2.5,
        gate_heights=0.6,
        gate_speed=10.0,
        birth_max_iou=0.05,
        birth_min_peak_score=0.7,
        birth_min_score=0.5,
        birth_min_visible=0.8,
    ),
    CostSettings(displacement=1.0, gate=1.2, motion_slack=0.5, motion_drift=2.5, reappearance_drift=2.5),
    InteractiveSettings(enabled=True),
)
"""Settings in box heights for bodies that are three times as long as high, and turn.

Nobody enters or leaves: a new box on a known fish is a part of it."""

PLAYERS = TrackingSetup(WindowSettings(), CostSettings(), InteractiveSettings(enabled=True))
"""MyView's defaults."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackedClip:
    """The tracking result of a clip.

    Attributes:
        clip: the clip.
        failures: remaining identity failures, after all repairs.
        risk_events: risk events, with the newest frame when they were reported.
        flags: flags that the operator got.
        tracks: the boxes by frame and id.
    """

    clip: Clip
    failures: list[IdentityFailure]
    risk_events: list[tuple[int, RiskEvent]]
    flags: list[OperatorFlag]
    tracks: dict[int, dict[int, Floats]]


def track_clip(
    clip: Clip,
    setup: TrackingSetup,
    person: OperatorProfile | None = None,
    selector: FlagSelector | None = None,
) -> TrackedClip:
    """Track a clip as a camera does, frame by frame, with an operator if there is a profile.

    Without a flag selector, all risk events raise flags.
    """
    selector = selector or FlagSelector(_ALL, clip.fps)
    selector.begin()
    tracker = CorrectableTracker(setup.window, setup.costs, create_solver(DEFAULT_SOLVER), setup.assist)
    operator = SimulatedOperator(person, selector, clip.truth, clip.fps, clip.seed) if person else None
    shown: dict[int, dict[int, Floats]] = {}
    risk_events: list[tuple[int, RiskEvent]] = []
    waiting: list[PositionCorrection] = []
    count = len(clip.detections)
    for newest in range(count + (operator.after if operator else 0)):
        if newest < count:
            result = tracker.push(newest, clip.detections[newest])
            _merge_result(shown, result)
            found: Sequence[RiskEvent] = result.risk_events if result else ()
            risk_events += [(newest, event) for event in found]
            if operator:
                operator.receive(newest, found)
        elif newest == count:
            _merge_result(shown, tracker.flush())
        pointing = operator.point(newest, shown) if operator else None
        waiting += [pointing] if pointing else []
        if waiting and newest % _BATCH == 0:
            _merge_result(shown, tracker.apply_corrections(waiting))
            waiting = []
    _merge_result(shown, tracker.flush())
    _merge_result(shown, tracker.apply_corrections(waiting))
    failed = failures(clip.truth, shown, clip.fps)
    return TrackedClip(clip, failed, risk_events, operator.flags if operator else [], shown)


def track_by_states(clip: Clip, setup: TrackingSetup) -> TrackedClip:
    """Track a clip by the thesis's state machine, without an operator; its flags are the risk events."""
    tracker = FlagStatesTracker(setup.window, fps=clip.fps)
    shown: dict[int, dict[int, Floats]] = {}
    raised: list[tuple[int, RiskEvent]] = []
    for newest, detections in enumerate(clip.detections):
        result = tracker.push(newest, detections)
        _merge_result(shown, result)
        raised += [(newest, event) for event in (result.risk_events if result else ())]
    _merge_result(shown, tracker.flush())
    return TrackedClip(clip, failures(clip.truth, shown, clip.fps), raised, [], shown)


def _merge_result(shown: dict[int, dict[int, Floats]], result: WindowResult | None) -> None:
    """Replace the boxes of the frames of a result."""
    if result is None:
        return
    for frame in range(result.first, result.last + 1):
        rows = {track.id: track.interpolated[frame - result.first] for track in result.tracks}
        shown[frame] = {number: box for number, box in rows.items() if not np.isnan(box[0])}
