"""The same number for the same person in every camera, for as long as anybody remembers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.appearance import Appearances, distances, normalised
from bestview.corrections import Corrections, Merge, Split
from bestview.evidence import PairEvidence, TrackKey
from bestview.ground import checked_homography
from bestview.grouping import GroupingProblem, group
from bestview.identity_settings import IdentitySettings
from bestview.likeness import appearance_scores, ground_scores
from bestview.people import People
from bestview.persons import Finding
from bestview.sightings import FootError, HeightScale, LocalTrack, Sightings, line_up
from bestview.succession import Heirs

_SETTLED_UPDATES = 10
"""Updates after which a mean histogram is more the person's than the moment's."""


@dataclass(frozen=True, slots=True)
class IdentityUpdate:
    """Who is who after one update; every tuple is in rising order.

    Attributes:
        numbers: the person's number of each track given, seen or hidden; a track whose person is not
            confirmed yet is missing.
        born: numbers given for the first time.
        returned: numbers of people who had gone and are back.
        gone: numbers of people whom no camera has seen for a while; they are remembered.
        merged: numbers that turned out to be one person.
        split: numbers that stood for somebody else than who was behind them before.
    """

    numbers: Mapping[TrackKey, int]
    born: tuple[int, ...]
    returned: tuple[int, ...]
    gone: tuple[int, ...]
    merged: tuple[Merge, ...]
    split: tuple[Split, ...]


class IdentityRegistry:
    """Joins the cameras' tracks into persons, update by update.

    Pairs of tracks gather evidence (the distance of their feet where both cameras have a homography,
    their likeness where not); one assignment groups the tracks into persons, in which two tracks seen
    at once in one camera are two people; hysteresis keeps what is joined joined until the evidence
    against it has mounted. Numbers count from 1 and are not used twice. Same updates, same numbers.

    Args:
        settings: see there.
        homographies: by camera name, image pixels -> common ground plane; None: not calibrated.

    Raises:
        ValueError: a homography that is none.
    """

    def __init__(
        self,
        settings: IdentitySettings,
        homographies: Mapping[str, NDArray[np.float64] | None],
    ) -> None:
        self._settings = settings
        self._foot_error = FootError(settings.foot_sideways, settings.foot_upwards)
        self._homographies = {
            camera: None if matrix is None else checked_homography(matrix, f"camera {camera}")
            for camera, matrix in sorted(homographies.items())
        }
        self._camera = {camera: i for i, camera in enumerate(self._homographies)}
        self._scale = HeightScale()
        self._appearances = Appearances()
        self._pairs = PairEvidence()
        self._people = People(settings)
        self._heirs = Heirs(settings.continuity)
        self._corrections = Corrections()
        self._last_frame: int | None = None

    def update(self, tracks: Sequence[LocalTrack], last_frame: int) -> IdentityUpdate:
        """Take in all cameras' tracks of the window that ends with `last_frame`.

        Call it once per solved window; windows may overlap. A track that is missing may come back.

        Raises:
            ValueError: frames that do not advance, or tracks that make no sense (see `line_up`).
        """
        if self._last_frame is not None and last_frame <= self._last_frame:
            raise ValueError(f"the update for frame {last_frame} comes after that for {self._last_frame}")
        seen = line_up(tracks, self._homographies, last_frame, self._foot_error)
        since = last_frame - seen.boxes.shape[1] if self._last_frame is None else self._last_frame
        self._last_frame = last_frame
        present = seen.present(since, last_frame)
        given = {track.key: track for track in tracks}
        looks = [normalised(given[key].histogram) for key in seen.keys]
        self._scale.learn(seen.heights)

        for key in seen.keys:
            self._people.meet(key, last_frame)
        self._gather(seen, present, last_frame)
        merged = self._regroup(seen, self._inherit(seen, present))
        self._remember(seen, looks, present)
        finding = Finding(self._settings, self._appearances, self._gate(), self._scale.height)
        born, found = self._people.confirm(finding, since)
        gone, returned = self._people.comings_and_goings(last_frame)
        numbers = {key: self._people.person(key).number for key in seen.keys}
        numbers = {key: number for key, number in numbers.items() if number}
        self._people.forget(last_frame)
        split = self._corrections.update(numbers, merged)
        self._corrections.keep_only(self._people.tracks)
        return IdentityUpdate(
            numbers=numbers,
            born=tuple(sorted(born)),
            returned=tuple(sorted(found + returned)),
            gone=tuple(sorted(gone)),
            merged=tuple(sorted(merged)),
            split=split,
        )

    def _gate(self) -> float:
        """Distance between feet at which they are as likely one person's as two's, ground units."""
        settings = self._settings
        return settings.gate if settings.gate is not None else settings.gate_heights * self._scale.height

    def _unlike(self, seen: Sightings, present: NDArray[np.bool_]) -> NDArray[np.float64]:
        """(T, T) appearance distances between the tracks present whose looks have settled; NaN: unknown.

        Learns on the way how each camera renders people, and how much people differ.
        """
        looks: list[NDArray[np.float64] | None] = []
        for key, here in zip(seen.keys, present, strict=True):
            person = self._people.person(key)
            look = person.looks.get(key.camera)
            settled = here and look is not None and look.count >= _SETTLED_UPDATES
            looks.append(look.total / look.count if settled and look is not None else None)
            # Once per track: somebody who stands about must not weigh more than who walks through.
            if looks[-1] is not None and person.tracks.get(key, 0) == _SETTLED_UPDATES:
                self._appearances.learn(key.camera, looks[-1])
        apart = distances(
            [
                None if look is None else self._appearances.equalised(key.camera, look)
                for key, look in zip(seen.keys, looks, strict=True)
            ]
        )
        self._appearances.learn_different(apart[np.triu(seen.side_by_side()) & ~np.isnan(apart)])
        return apart

    def _gather(
        self,
        seen: Sightings,
        present: NDArray[np.bool_],
        last_frame: int,
    ) -> None:
        """Count what this update says about every pair of tracks."""
        cameras = [key.camera for key in seen.keys]
        alike = appearance_scores(
            self._unlike(seen, present),
            np.array([self._camera[camera] for camera in cameras], dtype=np.int64),
            self._appearances.gate(self._settings.appearance_gate, self._settings.appearance_share),
        )
        calibrated = np.array([self._homographies[camera] is not None for camera in cameras], dtype=bool)
        on_ground = calibrated[:, None] & calibrated[None, :]
        scores = np.where(on_ground, ground_scores(seen.distances(self._gate())), alike)
        scores[seen.same_camera() | ~(present[:, None] & present[None, :])] = np.nan

        keys = self._people.tracks_heard_since(last_frame - self._settings.track_memory)
        self._pairs.follow(keys)
        self._pairs.add(seen.keys, scores, seen.side_by_side(), self._settings.memory, self._settings.cap)

    def _inherit(self, seen: Sightings, present: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Note who is whose heir; (T,) who of those present stays so: whoever has an heir now does not."""
        sighted = {seen.keys[i]: seen.places(i) for i in np.flatnonzero(present).tolist()}
        stays = present.copy()
        for heir in self._heirs.update(self._pairs.keys, sighted, seen.first):
            self._pairs.inherit(heir.heir, heir.lost, self._settings.heir * heir.score)
            if heir.lost in sighted:
                stays[seen.keys.index(heir.lost)] = False
        return stays

    def _regroup(self, seen: Sightings, present: NDArray[np.bool_]) -> tuple[Merge, ...]:
        """Group the tracks present into persons anew."""
        keys = self._pairs.keys
        here = np.zeros(len(keys), dtype=bool)
        here[self._pairs.places(seen.keys)] = present
        if not here.any():
            return ()
        problem = GroupingProblem(
            evidence=self._pairs.evidence,
            rivals=self._pairs.rivals,
            camera=np.array([self._camera[key.camera] for key in keys], dtype=np.int64),
            person=self._people.serials(keys),
            present=here,
            hold=np.array([self._people.hold(key) for key in keys]),
            join=self._settings.join,
        )
        return self._people.regroup(self._pairs, group(problem), here)

    def _remember(
        self,
        seen: Sightings,
        looks: Sequence[NDArray[np.float64] | None],
        present: NDArray[np.bool_],
    ) -> None:
        """Write down where each person was seen, and how they looked."""
        counted = []
        for i in np.flatnonzero(present).tolist():
            key, look = seen.keys[i], looks[i]
            first, last = seen.places(i)
            person = self._people.person(key)
            person.see(key, first, last)
            if look is not None:
                person.look(key.camera, look)
            if person not in counted:
                person.updates += 1
                counted.append(person)
