"""Initiation and departure of people. In the report the number of people is given (section 2.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tracking.baselines.temporal_consistency.blobs import Blob
from tracking.baselines.temporal_consistency.distance import stepped_distance_m
from tracking.baselines.temporal_consistency.settings import TemporalSettings
from tracking.baselines.temporal_consistency.window import Stage, StageDecision, TemporalWindow


@dataclass(frozen=True, slots=True, eq=False)
class _UnassignedBlob:
    """A blob without a person, and its consecutive decided stages without one."""

    blob: Blob
    stages: int


class PersonLifecycle:
    """Decides which blobs are new people, and which people have left."""

    def __init__(self, settings: TemporalSettings, pixels_per_meter: float) -> None:
        self._settings, self._pixels_per_meter = settings, pixels_per_meter
        self._unassigned: list[_UnassignedBlob] = []
        self._absent_stages: dict[int, int] = {}
        """By person id: consecutive decided stages of absence."""

    def find_new(self, window: TemporalWindow, done: StageDecision) -> list[int]:
        """Return the blobs of a decided stage that are new people, the largest first.

        Such a blob is as large as a person and unassigned in `confirm_stages` consecutive stages; pending
        stages count too.
        """
        assigned = set(done.blob_by_id.values())
        least = self._settings.min_person_m2 * self._pixels_per_meter**2
        new, unassigned = [], []
        for at, blob in enumerate(done.stage.blobs):
            if at in assigned or blob.area < least:
                continue
            before = max(
                (earlier.stages for earlier in self._unassigned if self._reachable(earlier.blob, blob)),
                default=0,
            )
            if before + 1 + self._pending_stages(window, blob) >= self._settings.confirm_stages:
                new.append(at)
            else:
                unassigned.append(_UnassignedBlob(blob, before + 1))
        self._unassigned = unassigned
        room = max(self._settings.max_people - len(window.people), 0)
        return sorted(new, key=lambda at: -done.stage.blobs[at].area)[:room]

    def find_departed(self, done: StageDecision, stage_s: float) -> set[int]:
        """Return the ids of people who have been absent for `forget_after_s`."""
        self._absent_stages = {
            number: self._absent_stages.get(number, 0) + 1
            for number, at in done.blob_by_id.items()
            if at == done.stage.absent
        }
        departed = {
            number
            for number, stages in self._absent_stages.items()
            if stages * stage_s >= self._settings.forget_after_s
        }
        for number in departed:
            del self._absent_stages[number]
        return departed

    def _pending_stages(self, window: TemporalWindow, blob: Blob) -> int:
        """Count the consecutive pending stages with an unassigned blob nearby."""
        if window.path is None:
            return 0
        count = 0
        for stage, chosen in zip(window.pending, window.path.blobs, strict=True):
            unassigned = np.setdiff1d(np.arange(len(stage.blobs)), chosen)
            near = [stage.blobs[at] for at in unassigned.tolist() if self._reachable(blob, stage.blobs[at])]
            if not near:
                break
            blob, count = near[0], count + 1
        return count

    def _reachable(self, before: Blob, after: Blob) -> bool:
        """Return whether a person can have walked from one blob to the other within a stage."""
        reach = self._settings.speed_m_s * self._settings.stage_s
        return stepped_distance_m(before, after, self._pixels_per_meter, self._settings) <= reach


def initial_people(
    stage: Stage, settings: TemporalSettings, pixels_per_meter: float
) -> list[tuple[int, int]]:
    """Return pairs of new id and blob index for the first stage's blobs that are as large as a person."""
    least = settings.min_person_m2 * pixels_per_meter**2
    large = [at for at, blob in enumerate(stage.blobs) if blob.area >= least]
    return [(number + 1, at) for number, at in enumerate(large[: settings.max_people])]
