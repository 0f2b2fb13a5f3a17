"""The moving window: samples come in, decisions come out as many stages later (sections 2.1 and 2.2)."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tracking.baselines.temporal_consistency.blobs import Blob
from tracking.baselines.temporal_consistency.distance import penalties, penalty
from tracking.baselines.temporal_consistency.graph import Graph, Ways, ways
from tracking.baselines.temporal_consistency.groups import JointPath, joint_path
from tracking.baselines.temporal_consistency.regional_appearance import Places
from tracking.baselines.temporal_consistency.settings import TemporalSettings
from tracking.boxes import Floats, intersections


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """A sample: what was seen at a frame."""

    frame: int
    blobs: tuple[Blob, ...]

    @property
    def nowhere(self) -> int:
        """The index that stands for no blob at all."""
        return len(self.blobs)


@dataclass(slots=True, eq=False)
class Person:
    """Somebody who is followed: their number, looks, and the index of their blob in the decided stage."""

    number: int
    looks: Places
    at: int


@dataclass(frozen=True, slots=True, eq=False)
class Commitment:
    """What was decided of a stage.

    Attributes:
        stage: which one.
        blobs: by person's number, the index of the blob, or `stage.nowhere`.
    """

    stage: Stage
    blobs: dict[int, int]


class TemporalWindow:
    """Decides where a known number of people is, at each stage after `stages` samples.

    Attributes:
        people: who is followed, by ascending number.
        decided: the last decided stage.
        waiting: the stages after it.
        path: everybody's best path through these, as it stands; None before the first of them.
    """

    def __init__(
        self, settings: TemporalSettings, size: tuple[int, int], metre: float, frame_s: float
    ) -> None:
        """Look at pictures of a size (width, height), `metre` pixels a metre, a frame each `frame_s`."""
        self._settings, self._size, self._metre, self._frame_s = settings, size, metre, frame_s
        self.people: list[Person] = []
        self.decided: Stage | None = None
        self.waiting: deque[Stage] = deque()
        self.path: JointPath | None = None
        self.graph: Graph | None = None
        """The graph that `path` goes through, and what pruning has left of it."""
        self.ways: Ways = ()
        self._steps: deque[Floats] = deque()

    def begin(self, stage: Stage, people: Sequence[tuple[int, int]]) -> None:
        """Start from a stage in which it is known who is where: pairs of number and blob."""
        self.decided, self.path = stage, None
        self.waiting.clear()
        self._steps.clear()
        self.people = [self._person(number, at) for number, at in people]
        self._learn(stage)

    def push(self, stage: Stage) -> Commitment | None:
        """Take a sample; decide the oldest that waits if as many as the window has stages do.

        Raises:
            ValueError: it is not known yet who is where, or the frame is not after the last one.
        """
        before = self.waiting[-1] if self.waiting else self.decided
        if before is None:
            raise ValueError("a window begins with a stage in which it is known who is where")
        if stage.frame <= before.frame:
            raise ValueError(f"the stage of frame {stage.frame} came after that of frame {before.frame}")
        self.waiting.append(stage)
        self._steps.append(self._between(before, stage))
        self._solve()
        return self.commit() if len(self.waiting) >= self._settings.stages else None

    def commit(self) -> Commitment | None:
        """Decide the oldest stage that waits; None: none does."""
        if not self.waiting or self.path is None:
            return None
        stage, chosen = self.waiting.popleft(), self.path.blobs[0]
        self._steps.popleft()
        for person, at in zip(self.people, chosen.tolist(), strict=True):
            person.at = at
        rest = self.path.blobs[1:]
        self.path = JointPath(rest, self.path.cost, self.path.exact) if self.waiting else None
        self.decided = stage
        self._learn(stage)
        return Commitment(stage, {person.number: person.at for person in self.people})

    def add(self, number: int, at: int) -> None:
        """Take somebody in who is in a blob of the decided stage."""
        self.people.append(self._person(number, at))
        self._learn_of(self.people[-1])
        self._solve()

    def remove(self, numbers: set[int]) -> None:
        """Forget people."""
        kept = [row for row, person in enumerate(self.people) if person.number not in numbers]
        self.people = [self.people[row] for row in kept]
        if self.path is not None:
            self.path = JointPath(self.path.blobs[:, kept], self.path.cost, self.path.exact)

    def _person(self, number: int, at: int) -> Person:
        return Person(number, Places(self._settings.places, self._size), at)

    def _solve(self) -> None:
        """Find the best path through all stages that wait."""
        if not self.waiting:
            return
        settings = self._settings
        longest = penalty(settings.prune) if settings.prune else np.inf
        self.graph = Graph(
            np.array([person.at for person in self.people], dtype=np.int64),
            tuple(self._steps),
            tuple(self._looks(stage) for stage in self.waiting),
            tuple(np.arange(len(stage.blobs) + 1) < stage.nowhere for stage in self.waiting),
            settings.merge,
            longest,
        )
        self.ways = ways(self.graph)
        self.path = joint_path(self.graph, self.ways, settings.most_states)

    def _looks(self, stage: Stage) -> Floats:
        """Give f_colour of everybody in every blob, and of being nowhere: `(P, B + 1)`."""
        costs = np.full((len(self.people), len(stage.blobs) + 1), self._settings.outside)
        if stage.blobs:
            middles = np.stack([blob.middle for blob in stage.blobs])
            colours = np.stack([blob.colours for blob in stage.blobs])
            for row, person in enumerate(self.people):
                costs[row, :-1] = person.looks.costs(middles, colours, self._settings.unknown)
        return costs

    def _between(self, before: Stage, after: Stage) -> Floats:
        """Give f_dist between two stages, nowhere included: `(B' + 1, B + 1)`."""
        seconds = (after.frame - before.frame) * self._frame_s
        costs = np.full((len(before.blobs) + 1, len(after.blobs) + 1), np.inf)
        costs[:-1, :-1] = penalties(before.blobs, after.blobs, seconds, self._metre, self._settings)
        if not self._settings.closed:
            costs[:-1, -1] = [self._way_out(blob) for blob in before.blobs]
            costs[-1, :-1] = [self._way_out(blob) for blob in after.blobs]
            costs[-1, -1] = 0.0
        return costs

    def _way_out(self, blob: Blob) -> float:
        """Give what it costs to leave the picture from a blob, or to come in there."""
        left, top, right, bottom = blob.box.tolist()
        room = min(left, top, self._size[0] - right, self._size[1] - bottom)
        at_edge = room < self._settings.apart * self._metre
        return self._settings.leave if at_edge else self._settings.vanish

    def _learn(self, stage: Stage) -> None:
        """Learn how everybody looks who is by themselves in a stage that is decided (section 2.2)."""
        for person in self.people:
            if person.at < stage.nowhere:
                self._learn_of(person)

    def _learn_of(self, person: Person) -> None:
        stage = self.decided
        if stage is None or person.at >= stage.nowhere:
            return
        others = [it.at for it in self.people if it is not person and it.at < stage.nowhere]
        if person.at in others:
            return
        blob, reach = stage.blobs[person.at], self._settings.isolated_m * self._metre
        around = blob.box + reach * np.array([-1.0, -1.0, 1.0, 1.0])
        if not any(float(intersections(around, stage.blobs[it].box)) > 0.0 for it in others):
            person.looks.learn(blob.middle, blob.colours)
