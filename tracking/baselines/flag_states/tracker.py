"""A tracker whose targets run through the flag states (Todor 2009, section 8.2).

A component is a detection's box. Targets are predicted by Kalman filters, and matched like those of all
frame-by-frame trackers, with one exception: a target whose component merged with a larger target's waits
until a second component appears beside it, of which the smaller one is its own. Flags are risk events of
certainty: `crossing` of two equally large targets that come close, `track_loss` of a target without a
component.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from tracking.baselines.flag_states.machine import ComponentView, FlagState, next_state
from tracking.baselines.frame_by_frame import StepwiseSettings, StepwiseTrack
from tracking.baselines.kalman_prediction import KalmanPrediction
from tracking.baselines.stepwise import StepwiseTracker
from tracking.boxes import Floats, areas, intersections
from tracking.detectors.base import Image
from tracking.frame_rate import DEFAULT_FPS
from tracking.solvers.base import OCCLUDED
from tracking.types import Detections, RiskEvent, RiskReason
from tracking.window import WindowResult, WindowSettings


@dataclass(frozen=True, slots=True)
class FlagStateSettings:
    """Thresholds of the transitions.

    Raises:
        ValueError: a setting is out of range.
    """

    margin_heights: float = 0.25  # distance in which another component is close, in heights of the target
    max_size_ratio: float = 0.8  # share of the larger area from which sizes do not tell targets apart
    min_merge_ratio: float = 2.0  # growth of a component's area from one frame to the next that is a merge
    min_covered_share: float = 0.3  # share of an undetected target that the other's component covers: a merge

    def __post_init__(self) -> None:
        if self.margin_heights < 0.0 or self.min_merge_ratio <= 1.0:
            raise ValueError("margin_heights must be at least 0, min_merge_ratio must be above 1")
        if not 0.0 < self.max_size_ratio <= 1.0 or not 0.0 < self.min_covered_share <= 1.0:
            raise ValueError("max_size_ratio and min_covered_share must be shares above 0")


@dataclass(slots=True, eq=False)
class _Watched:
    """A target's state, its partner while close or occluded, and its component's last area."""

    state: FlagState = FlagState.OK
    partner: StepwiseTrack[cv2.KalmanFilter] | None = None
    area: float = 0.0


class FlagStatesTracker(StepwiseTracker[cv2.KalmanFilter]):
    """Tracks detections, keeps the smaller of two merged targets, and flags doubtful ones."""

    def __init__(
        self,
        window: WindowSettings,
        settings: StepwiseSettings | None = None,
        flags: FlagStateSettings | None = None,
        fps: float = DEFAULT_FPS,
    ) -> None:
        super().__init__(KalmanPrediction(), window, settings, fps)
        self._flags = flags or FlagStateSettings()
        self._watched: dict[int, _Watched] = {}
        self._raised: list[tuple[int, RiskReason, tuple[StepwiseTrack[cv2.KalmanFilter], ...]]] = []

    def _step(self, frame: int, detections: Detections, image: Image | None) -> None:
        super()._step(frame, detections, image)
        alive = {track.serial for track in self._objects}
        self._watched = {serial: watched for serial, watched in self._watched.items() if serial in alive}
        for watched in self._watched.values():
            if watched.partner is not None and watched.partner.serial not in alive:
                # Nobody is left whose component could split.
                watched.partner, watched.state = None, FlagState.OK

    def _match(self, frame: int, detections: Detections) -> NDArray[np.bool_]:
        everyone = self._objects
        self._objects = [track for track in everyone if not self._of(track).state.is_occluded]
        matched = super()._match(frame, detections)
        self._objects = everyone
        before = {track.serial: self._of(track).state for track in everyone}
        for track in everyone:
            if self._of(track).state.is_occluded:
                self._wait(frame, track, detections, matched)
            elif self._is_confirmed(track):
                self._advance(frame, track, detections)
        for track in everyone:
            watched = self._of(track)
            if watched.state.is_flagged and not before[track.serial].is_flagged:
                both = (track,) if watched.partner is None else (track, watched.partner)
                self._raised.append((frame, "track_loss" if len(both) == 1 else "crossing", both))
        return matched

    def _of(self, track: StepwiseTrack[cv2.KalmanFilter]) -> _Watched:
        return self._watched.setdefault(track.serial, _Watched())

    def _advance(self, frame: int, track: StepwiseTrack[cv2.KalmanFilter], detections: Detections) -> None:
        """Update the state of a target that has a component of its own, or lost it in this frame."""
        watched, own = self._of(track), _component(track, frame, detections)
        near = watched.partner if watched.state.is_close else self._neighbor(frame, track, detections)
        there = None if near is None else _component(near, frame, detections)
        touches = there is not None and float(intersections(there, self._around(track))) > 0.0
        view = ComponentView(
            None if own is None else float(areas(own)),
            float(areas(there)) if touches and there is not None else None,
            merged=watched.state.is_close and self._has_merged(frame, track, near, detections),
        )
        watched.state = next_state(watched.state, view, self._flags.max_size_ratio)
        watched.partner = near if watched.state.is_close or watched.state.is_occluded else None
        if own is not None and not watched.state.is_occluded:
            watched.area = float(areas(own))

    def _has_merged(
        self,
        frame: int,
        track: StepwiseTrack[cv2.KalmanFilter],
        near: StepwiseTrack[cv2.KalmanFilter] | None,
        detections: Detections,
    ) -> bool:
        """Return whether two components have become one, which the larger target then gets."""
        if near is None:
            return False
        own, there = _component(track, frame, detections), _component(near, frame, detections)
        if own is None and there is not None:
            covered = float(intersections(there, track.box))
            return covered >= self._flags.min_covered_share * float(areas(track.box))
        if own is None or there is not None:
            return False
        if float(areas(own)) <= self._flags.min_merge_ratio * self._of(track).area:
            return False
        near.observations[frame] = track.observations.pop(frame)
        near.box = self._method.update(near.target, own)
        near.missed_frames = 0
        return True

    def _wait(
        self,
        frame: int,
        track: StepwiseTrack[cv2.KalmanFilter],
        detections: Detections,
        matched: NDArray[np.bool_],
    ) -> None:
        """Look for a second component beside that of the partner; the smaller one is this target's."""
        watched = self._of(track)
        partner = watched.partner
        track.missed_frames = 0  # it is there, behind the other one
        if partner is None:
            return
        there = _component(partner, frame, detections)
        found = [] if there is None else self._beside(there, detections, matched)
        if there is None or not found:
            track.box = partner.box
            return
        second = found[0]
        mine, theirs = second, partner.observations[frame][1]
        if float(areas(detections.boxes[mine])) > float(areas(there)):
            mine, theirs = theirs, mine
        for who, index in ((track, mine), (partner, theirs)):
            who.target = self._method.initialize(np.empty((0, 0, 3), dtype=np.uint8), detections.boxes[index])
            who.box = detections.boxes[index]
            who.observations[frame] = (who.box, index)
        track.matches += 1
        matched[second] = True
        watched.state = next_state(
            watched.state, ComponentView(float(areas(track.box)), split=True), self._flags.max_size_ratio
        )
        watched.area = float(areas(track.box))

    def _beside(self, box: Floats, detections: Detections, matched: NDArray[np.bool_]) -> list[int]:
        """Return the unmatched components that touch the margin of a box, the nearest first."""
        shared = intersections(detections.boxes, self._with_margin(box))
        order = np.argsort(-shared, kind="stable").tolist()
        return [index for index in order if shared[index] > 0.0 and not matched[index]]

    def _neighbor(
        self, frame: int, track: StepwiseTrack[cv2.KalmanFilter], detections: Detections
    ) -> StepwiseTrack[cv2.KalmanFilter] | None:
        """Return the confirmed target whose component shares most with the target's margin, if any does."""
        around, best, found = self._around(track), 0.0, None
        for other in self._objects:
            there = _component(other, frame, detections)
            if other is track or there is None or not self._is_confirmed(other):
                continue
            shared = float(intersections(there, around))
            if shared > best:
                best, found = shared, other
        return found

    def _around(self, track: StepwiseTrack[cv2.KalmanFilter]) -> Floats:
        return self._with_margin(track.box)

    def _with_margin(self, box: Floats) -> Floats:
        margin = self._flags.margin_heights * (box[3] - box[1])
        return np.asarray(box + margin * np.array([-1.0, -1.0, 1.0, 1.0]))

    def _result(self, last: int) -> WindowResult:
        result = super()._result(last)
        events = [
            RiskEvent(reason, tuple(track.id for track in tracks), frame, 0.0, 0, 1.0)
            for frame, reason, tracks in self._raised
            if all(track.id for track in tracks)
        ]
        self._raised = []
        return replace(result, risk_events=tuple(events))


def _component(track: StepwiseTrack[cv2.KalmanFilter], frame: int, detections: Detections) -> Floats | None:
    """Return the component `(4,)` that a target was matched with in a frame, `None` without one."""
    _, index = track.observations.get(frame, (track.box, OCCLUDED))
    return None if index == OCCLUDED else np.asarray(detections.boxes[index])
