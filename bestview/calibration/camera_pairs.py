"""Two cameras: whether they see one floor, how they stand to each other on it, and how far out of step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bestview.calibration.bundle_adjustment import Matches, Rig, refined, sharpness_of
from bestview.calibration.chance_agreement import backwards, late
from bestview.calibration.covisibility import shared
from bestview.calibration.floor_agreement import apart, matched, placed, score, taken, tally
from bestview.calibration.homography import Floats
from bestview.calibration.pair_hypotheses import Guess, guesses
from bestview.calibration.pinhole import EAST, NORTH, PAN, Pinhole
from bestview.calibration.samples import Meetings, Samples, meetings, sample
from bestview.calibration.walk import Walk
from bestview.calibration.walk_settings import WalkSettings

_GUESSES = 60
"""Guesses looked at for each offset that is tried."""
_REFINED = 3
"""Guesses that are refined, the best ones ..."""
_NEARLY = 0.7
"""... as far as they are this share as good as the very best."""
_ROUNDS = 3
_OFFSET_STEPS = 2
"""Offsets are tried this many times `step` apart; between them they are refined."""
_MOST_MEETINGS = 20_000
"""Of more, moments are left out."""


@dataclass(frozen=True, slots=True)
class Seer:
    """A camera: what it saw, and how it may look down on the floor."""

    walk: Walk
    views: tuple[Pinhole, ...]


@dataclass(frozen=True, slots=True)
class Link:
    """Two cameras on one floor, perhaps.

    Attributes:
        rig: both of them; the first is at the origin, its offset 0.
        places: at how many places they agree about who stands there.
        share: about what share that is of all that both could see.
        error: how far apart they have the same people, person heights (median).
        chance: what places times share would be by chance.
        breadth: how broad the walk is that both saw: standard deviation across its main direction,
            person heights.
    """

    rig: Rig
    places: float
    share: float
    breadth: float
    error: float
    chance: float = 0.0

    @property
    def merit(self) -> float:
        """What links are compared by."""
        return self.places * self.share


def link(one: Seer, other: Seer, settings: WalkSettings) -> Link | None:
    """Find out how two cameras stand to each other; None where nobody walked in both at once."""
    best = _best(one, other, settings)
    if best is None:
        return None
    wrong = [
        _best(one, replace(other, walk=it), settings) for it in (backwards(other.walk), late(other.walk))
    ]
    return replace(best, chance=max((it.merit for it in wrong if it is not None), default=0.0))


def pulses_of(walks: Sequence[Walk], settings: WalkSettings) -> Floats:
    """Give the moments at which cameras are compared, (T,)."""
    last = max(walk.end for walk in walks)
    return np.arange(-settings.shift, last + settings.shift + 1, settings.step, dtype=np.float64)


def _best(one: Seer, other: Seer, settings: WalkSettings) -> Link | None:
    pulses = pulses_of((one.walk, other.walk), settings)
    here = sample(one.walk, pulses, 0.0, settings.step, settings.stride)
    trials: list[tuple[float, float, Guess]] = []
    apart_by = settings.step * _OFFSET_STEPS
    steps = settings.shift // apart_by
    for offset in range(-steps * apart_by, steps * apart_by + 1, apart_by):
        there = sample(other.walk, pulses, float(offset), settings.step, settings.stride)
        meeting = meetings(here, there)
        if len(meeting.here) > _MOST_MEETINGS:
            fewer = pulses[:: -(-len(meeting.here) // _MOST_MEETINGS)]
            meeting = _within(meeting, np.isin(here.times[meeting.here], fewer))
        trials += [
            (places, float(offset), it) for places, it in _tried(one, here, other, there, meeting, settings)
        ]
    trials.sort(key=lambda it: (-it[0], abs(it[1])))
    found = [
        _refined(one, here, other, pulses, offset, guess, settings) for _, offset, guess in trials[:_REFINED]
    ]
    return max(found, key=lambda it: it.merit, default=None)


def _within(meeting: Meetings, chosen: np.ndarray) -> Meetings:
    some = np.flatnonzero(chosen)
    numbers, pair = np.unique(meeting.pair[some], return_inverse=True)
    scale = len(meeting.here) / max(1, len(some))
    return Meetings(
        meeting.here[some],
        meeting.there[some],
        pair.reshape(-1),
        meeting.tracks[numbers],
        meeting.weight[some] * scale,
    )


def _tried(
    one: Seer, here: Samples, other: Seer, there: Samples, meeting: Meetings, settings: WalkSettings
) -> list[tuple[float, Guess]]:
    """Give guesses with the places at which the cameras then agree, best first."""
    first = [placed(view, here.feet, here.tall, settings) for view in one.views]
    second = [placed(view, there.feet, there.tall, settings) for view in other.views]
    found = []
    for guess in guesses(first, second, meeting, _GUESSES):
        moved = first[guess.here].moved(guess.turn, guess.shift)
        off = apart(taken(moved, meeting.here), taken(second[guess.there], meeting.there), settings)
        found.append((score(tally(off, meeting, settings.gate), meeting), guess))
    found.sort(key=lambda it: -it[0])
    return found[:_REFINED]


def _rig(one: Seer, other: Seer, guess: Guess, offset: float) -> Rig:
    """Put the first camera at the origin and the other where the guess has it."""
    first, second = one.views[guess.here], other.views[guess.there]
    # The guess turns and shifts the first one's floor onto the second's; undo it for the second.
    cos, sin = np.cos(-guess.turn), np.sin(-guess.turn)
    parameters = second.parameters.copy()
    parameters[PAN] -= guess.turn
    parameters[[EAST, NORTH]] = -np.array([[cos, -sin], [sin, cos]]) @ guess.shift
    return Rig((first, replace(second, parameters=parameters)), np.array([0.0, offset]))


def _refined(
    one: Seer, here: Samples, other: Seer, pulses: Floats, offset: float, guess: Guess, settings: WalkSettings
) -> Link:
    rig = _rig(one, other, guess, offset)
    for gate in (*([settings.gate] * _ROUNDS), settings.sure):
        there = sample(other.walk, pulses, float(rig.offsets[1]), settings.step, settings.stride)
        meeting = meetings(here, there)
        off, places = compared(rig.cameras, (here, there), meeting, settings, gate)
        chosen = matched(off, places, here, there, meeting, gate)
        if gate == settings.sure or len(chosen) < _LEAST_MATCHES:
            break
        matches = Matches(0, 1, meeting.here[chosen], meeting.there[chosen], meeting.weight[chosen])
        rig = refined(
            rig,
            (here, there),
            [matches],
            settings,
            sharpness=sharpness_of(off[chosen]),
            in_step=settings.shift == 0,
        )
    floor = rig.cameras[0].floor(here.feet[meeting.here[chosen]])
    away = np.hypot(*(floor - rig.cameras[1].floor(there.feet[meeting.there[chosen]])).T)
    error = float(np.median(away)) if len(away) else float("inf")
    share = shared(rig.cameras, (here, there), (meeting.here[chosen], meeting.there[chosen]))
    return Link(rig, score(places, meeting), share, breadth(floor, meeting.weight[chosen]), error)


_LEAST_MATCHES = 8


def compared(
    cameras: Sequence[Pinhole],
    samples: Sequence[Samples],
    meeting: Meetings,
    settings: WalkSettings,
    gate: float,
) -> tuple[Floats, Floats]:
    """Give how far apart all meetings are, whitened (P, 2), and where pairs of tracks agree, (K,)."""
    first, second = (
        placed(camera, it.feet, it.tall, settings) for camera, it in zip(cameras, samples, strict=True)
    )
    off = apart(taken(first, meeting.here), taken(second, meeting.there), settings)
    return off, tally(off, meeting, gate)


def breadth(floor: Floats, weight: Floats) -> float:
    """The standard deviation of places (N, 2) across their main direction."""
    if not weight.sum() > 0:
        return 0.0
    middle = np.average(floor, axis=0, weights=weight)
    away = (floor - middle) * np.sqrt(weight / weight.sum())[:, None]
    return float(np.linalg.svd(away, compute_uv=False)[-1])
