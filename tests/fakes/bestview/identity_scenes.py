"""People who stand and walk in view of calibrated cameras, as tracks for the identity registry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from bestview import (
    AppearanceHistogram,
    IdentityRegistry,
    IdentitySettings,
    IdentityUpdate,
    TrackUpdate,
)

STRIDE = 5
FOCAL, EYE = 400.0, 3.0


def camera_from(side: str) -> NDArray[np.float64]:
    """Return the ground-to-image homography of a level camera 10 m from the origin, looking at it; meters."""
    level = np.array([[FOCAL, 320.0, 0.0], [0.0, 240.0, FOCAL * EYE], [0.0, 1.0, 0.0]])
    rotations = {
        "south": [[1, 0, 0], [0, 1, 10], [0, 0, 1]],
        "west": [[0, -1, 0], [1, 0, 10], [0, 0, 1]],
        "north": [[-1, 0, 0], [0, -1, 10], [0, 0, 1]],
    }
    return np.asarray(level @ np.array(rotations[side], float))


VIEWS = {side: camera_from(side) for side in ("north", "south", "west")}
CALIBRATED: Mapping[str, NDArray[np.float64] | None] = {
    side: np.asarray(np.linalg.inv(view), float) for side, view in VIEWS.items()
}
BLIND: Mapping[str, NDArray[np.float64] | None] = dict.fromkeys(VIEWS)
OPEN_TRACKLET_LIMITS = pytest.mark.parametrize("maximum_open", [400, 0], ids=["few", "too many at once"])
"""Values of `maximum_open_tracklets`: above it, certain identities are settled at once."""


@dataclass(frozen=True)
class StraightTrack:
    """A person's track in one camera, for some frames, along a line on the ground."""

    camera: str
    local_id: int
    start: int
    end: int
    place: tuple[float, float]
    speed: tuple[float, float] = (0.0, 0.0)
    coat: float = 0

    def box(self, frame: int) -> NDArray[np.float64]:
        x, y = (p + v * frame for p, v in zip(self.place, self.speed, strict=True))
        u, v, w = VIEWS[self.camera] @ (x, y, 1.0)
        height = FOCAL * 1.75 / w
        return np.array([u / w - 0.2 * height, v / w - height, u / w + 0.2 * height, v / w])

    def track(self, first: int, last: int) -> TrackUpdate:
        boxes = np.full((last - first + 1, 4), np.nan)
        visible = range(max(first, self.start), min(last, self.end) + 1)
        for frame in visible:
            boxes[frame - first] = self.box(frame)
        appearance = (
            (AppearanceHistogram(visible[0], visible[-1], coat(self.coat)),) if visible and self.coat else ()
        )
        return TrackUpdate(self.camera, self.local_id, first, boxes, appearance)


def coat(which: float) -> NDArray[np.float64]:
    """Return a color histogram with one peak, by coat."""
    peak = np.exp(-(((np.arange(64) - 8.0 * which) / 4.0) ** 2))
    return np.asarray(peak / peak.sum())


def collect_updates(
    registry: IdentityRegistry,
    stays: Sequence[StraightTrack],
    frames: int,
    start: int = 0,
    picture_sizes: Mapping[str, tuple[int, int]] | None = None,
) -> list[IdentityUpdate]:
    return list(updates(registry, stays, frames, start, picture_sizes))


def updates(
    registry: IdentityRegistry,
    stays: Sequence[StraightTrack],
    frames: int,
    start: int = 0,
    picture_sizes: Mapping[str, tuple[int, int]] | None = None,
) -> Iterator[IdentityUpdate]:
    for last in range(start + STRIDE - 1, frames, STRIDE):
        first = last - STRIDE + 1
        tracks: dict[tuple[str, int], TrackUpdate] = {}
        for stay in stays:
            if stay.start <= last and stay.end >= first:
                track = stay.track(first, last)
                before = tracks.get((stay.camera, stay.local_id))
                if before is not None:
                    boxes = np.where(np.isnan(track.boxes), before.boxes, track.boxes)
                    track = replace(track, boxes=boxes, appearance=(*before.appearance, *track.appearance))
                tracks[stay.camera, stay.local_id] = track
        yield registry.update(list(tracks.values()), last, picture_sizes)


def registry(
    homographies: Mapping[str, NDArray[np.float64] | None] = CALIBRATED, **changes: float
) -> IdentityRegistry:
    return IdentityRegistry(replace(IdentitySettings(), **changes), homographies)  # type: ignore[arg-type]


def in_two_cameras(
    local: int, place: tuple[float, float], start: int = 0, end: int = 999
) -> list[StraightTrack]:
    return [StraightTrack("south", local, start, end, place), StraightTrack("west", local, start, end, place)]


def persons_by_track(identity_updates: Sequence[IdentityUpdate]) -> dict[tuple[str, int], int]:
    """Return the person of each track after these updates, by camera and local id."""
    every = {key: number for update in identity_updates for key, number in update.person_ids.items()}
    newest = {key.track: number for key, number in sorted(every.items())}
    return {(key.camera, key.local_id): number for key, number in newest.items() if number}


def numbers(update: IdentityUpdate) -> dict[tuple[str, int], int]:
    """Return the person of each track in one update, by its newest tracklet, without unassigned tracks."""
    newest = {key.track: number for key, number in update.person_ids.items()}
    return {(key.camera, key.local_id): number for key, number in newest.items() if number}
