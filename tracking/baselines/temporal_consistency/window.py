"""The moving window: each sample is decided `window_stages` samples later (sections 2.1 and 2.2)."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.baselines.temporal_consistency.blobs import Blob
from tracking.baselines.temporal_consistency.distance import distance_cost, distance_costs
from tracking.baselines.temporal_consistency.graph import PersonLinks, StageGraph, prune_links
from tracking.baselines.temporal_consistency.joint_path import JointPath, solve_joint_path
from tracking.baselines.temporal_consistency.regional_appearance import RegionalAppearance
from tracking.baselines.temporal_consistency.settings import TemporalSettings
from tracking.boxes import Floats, intersections


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """A sample: the blobs of one frame."""

    frame: int
    blobs: tuple[Blob, ...]

    @property
    def absent(self) -> int:
        """The index that means no blob."""
        return len(self.blobs)


@dataclass(slots=True, eq=False)
class TrackedPerson:
    """A tracked person: id, appearance, and blob index in the decided stage."""

    id: int
    appearance: RegionalAppearance
    blob: int


@dataclass(frozen=True, slots=True, eq=False)
class StageDecision:
    """The decision of one stage.

    Attributes:
        stage: the decided stage.
        blob_by_id: by person id, the index of the blob, or `stage.absent`.
    """

    stage: Stage
    blob_by_id: dict[int, int]


class TemporalWindow:
    """Decides each stage for a known set of people, `window_stages` samples later.

    Attributes:
        people: the tracked people, by ascending id.
        decided: the last decided stage.
        pending: the stages after it.
        path: the current best joint path through these; None if there are none.
    """

    def __init__(
        self, settings: TemporalSettings, size: tuple[int, int], pixels_per_meter: float, frame_s: float
    ) -> None:
        """Set up for images of `size` (width, height), with frames of `frame_s`."""
        self._settings, self._size, self._pixels_per_meter, self._frame_s = (
            settings,
            size,
            pixels_per_meter,
            frame_s,
        )
        self.people: list[TrackedPerson] = []
        self.decided: Stage | None = None
        self.pending: deque[Stage] = deque()
        self.path: JointPath | None = None
        self.graph: StageGraph | None = None
        """The graph that `path` goes through; `links` are its links after pruning."""
        self.links: PersonLinks = ()
        self._steps: deque[Floats] = deque()

    def begin(self, stage: Stage, people: Sequence[tuple[int, int]]) -> None:
        """Start from a stage with known assignments: pairs of id and blob."""
        self.decided, self.path = stage, None
        self.pending.clear()
        self._steps.clear()
        self.people = [self._person(number, at) for number, at in people]
        self._learn(stage)

    def push(self, stage: Stage) -> StageDecision | None:
        """Add a sample; decide the oldest pending stage once the window is full.

        Raises:
            ValueError: `begin` was not called, or the frame is not after the last one.
        """
        before = self.pending[-1] if self.pending else self.decided
        if before is None:
            raise ValueError("begin() must be called with a first stage before push()")
        if stage.frame <= before.frame:
            raise ValueError(f"the stage of frame {stage.frame} came after that of frame {before.frame}")
        self.pending.append(stage)
        self._steps.append(self._distance_costs(before, stage))
        self._solve()
        return self.commit() if len(self.pending) >= self._settings.window_stages else None

    def commit(self) -> StageDecision | None:
        """Decide the oldest pending stage; `None` if there is none."""
        if not self.pending or self.path is None:
            return None
        stage, chosen = self.pending.popleft(), self.path.blobs[0]
        self._steps.popleft()
        for person, at in zip(self.people, chosen.tolist(), strict=True):
            person.blob = at
        remaining = self.path.blobs[1:]
        self.path = JointPath(remaining, self.path.cost, self.path.exact) if self.pending else None
        self.decided = stage
        self._learn(stage)
        return StageDecision(stage, {person.id: person.blob for person in self.people})

    def add(self, number: int, at: int) -> None:
        """Add a person who is in a blob of the decided stage."""
        self.people.append(self._person(number, at))
        self._learn_person(self.people[-1])
        self._solve()

    def remove(self, numbers: set[int]) -> None:
        """Remove people."""
        kept = [row for row, person in enumerate(self.people) if person.id not in numbers]
        self.people = [self.people[row] for row in kept]
        if self.path is not None:
            self.path = JointPath(self.path.blobs[:, kept], self.path.cost, self.path.exact)

    def _person(self, number: int, at: int) -> TrackedPerson:
        return TrackedPerson(number, RegionalAppearance(self._settings.appearance_regions, self._size), at)

    def _solve(self) -> None:
        """Find the best joint path through all pending stages."""
        if not self.pending:
            return
        settings = self._settings
        max_cost = distance_cost(settings.prune_factor) if settings.prune_factor else np.inf
        self.graph = StageGraph(
            np.array([person.blob for person in self.people], dtype=np.int64),
            tuple(self._steps),
            tuple(self._appearance_costs(stage) for stage in self.pending),
            tuple(np.arange(len(stage.blobs) + 1) < stage.absent for stage in self.pending),
            settings.merge_cost,
            max_cost,
        )
        self.links = prune_links(self.graph)
        self.path = solve_joint_path(self.graph, self.links, settings.max_joint_states)

    def _appearance_costs(self, stage: Stage) -> Floats:
        """Compute f_color of everyone in every blob, and the cost of absence: `(P, B + 1)`."""
        costs = np.full((len(self.people), len(stage.blobs) + 1), self._settings.absence_cost)
        if stage.blobs:
            centers = np.stack([blob.center for blob in stage.blobs])
            colors = np.stack([blob.colors for blob in stage.blobs])
            for row, person in enumerate(self.people):
                costs[row, :-1] = person.appearance.costs(centers, colors, self._settings.unknown_appearance)
        return costs

    def _distance_costs(self, before: Stage, after: Stage) -> Floats:
        """Compute f_dist between two stages, absence included: `(B' + 1, B + 1)`."""
        seconds = (after.frame - before.frame) * self._frame_s
        costs = np.full((len(before.blobs) + 1, len(after.blobs) + 1), np.inf)
        costs[:-1, :-1] = distance_costs(
            before.blobs, after.blobs, seconds, self._pixels_per_meter, self._settings
        )
        if not self._settings.closed_world:
            costs[:-1, -1] = [self._exit_cost(blob) for blob in before.blobs]
            costs[-1, :-1] = [self._exit_cost(blob) for blob in after.blobs]
            costs[-1, -1] = 0.0
        return costs

    def _exit_cost(self, blob: Blob) -> float:
        """Return the cost of leaving the image from a blob, or of entering there."""
        left, top, right, bottom = blob.box.tolist()
        margin = min(left, top, self._size[0] - right, self._size[1] - bottom)
        at_edge = margin < self._settings.no_overlap_m * self._pixels_per_meter
        return self._settings.border_exit_cost if at_edge else self._settings.inner_exit_cost

    def _learn(self, stage: Stage) -> None:
        """Update the appearance of all isolated people in a decided stage (section 2.2)."""
        for person in self.people:
            if person.blob < stage.absent:
                self._learn_person(person)

    def _learn_person(self, person: TrackedPerson) -> None:
        stage = self.decided
        if stage is None or person.blob >= stage.absent:
            return
        others = [other.blob for other in self.people if other is not person and other.blob < stage.absent]
        if person.blob in others:
            return
        blob, reach = stage.blobs[person.blob], self._settings.isolated_m * self._pixels_per_meter
        around = blob.box + reach * np.array([-1.0, -1.0, 1.0, 1.0])
        if not any(float(intersections(around, stage.blobs[other].box)) > 0.0 for other in others):
            person.appearance.store(blob.center, blob.colors)
