"""A person tracker whose identities the test decides."""

from __future__ import annotations

from collections.abc import Mapping

from bestview import IdentitySettings, IdentityUpdate, Merge, Split, TrackletKey, TrackUpdate
from fakes.service.scripted_cameras import CAMERAS, HEIGHT, WIDTH
from server.messaging.messages import Box
from server.service.identity.person_tracker import PersonTracker


def people(**settings: int) -> PersonTracker:
    identity = IdentitySettings(**{"confirmation_s": 0.04, "clustering_interval_s": 0.04, **settings})
    return PersonTracker(identity, CAMERAS, dict.fromkeys(CAMERAS), (WIDTH, HEIGHT), lag=0)


class ScriptedRegistry:
    """An identity registry that returns the updates of a test."""

    def __init__(self, *updates: IdentityUpdate) -> None:
        self._updates = list(updates)

    def update(
        self, tracks: list[TrackUpdate], last_frame: int, picture_sizes: Mapping[str, tuple[int, int]]
    ) -> IdentityUpdate:
        del tracks, last_frame, picture_sizes
        return self._updates.pop(0)


def boxes(people: PersonTracker, camera: str, pulse: int) -> dict[int, Box]:
    """Return all boxes in one frame by person number."""
    [rows] = people.boxes(camera, pulse, 1)
    numbers = [number for number, *_ in rows]
    assert numbers == sorted(set(numbers))
    return {number: (left, top, right, bottom) for number, left, top, right, bottom in rows}


def identity_update(numbers: dict[tuple[str, int], int], *corrections: Merge | Split) -> IdentityUpdate:
    keys = {TrackletKey(*key, 0): number for key, number in numbers.items()}
    merged = tuple(correction for correction in corrections if isinstance(correction, Merge))
    split = tuple(correction for correction in corrections if isinstance(correction, Split))
    return IdentityUpdate(person_ids=keys, created=(), returned=(), departed=(), merged=merged, split=split)
