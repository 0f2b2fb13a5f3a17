"""The same number for the same person in every camera, for as long as anybody remembers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.alignment import GroundAlignment
from bestview.appearance import KNOWN_PAIRS, Appearances, normalised
from bestview.corrections import Corrections, Merge, Split
from bestview.evidence import PairEvidence, TrackKey
from bestview.finding import Finding
from bestview.ground import checked_homography
from bestview.grouping import GroupingProblem, group
from bestview.heights import HeightScale
from bestview.identity_settings import IdentitySettings
from bestview.likeness import WORST, Scores, appearance_scores
from bestview.meeting import near_or_known
from bestview.people import People
from bestview.persons import Person
from bestview.settled import SettledLooks
from bestview.sightings import FootError, LocalTrack, Sightings, line_up
from bestview.succession import Heirs, Place


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
        self._pairs = PairEvidence(WORST, settings.memory, settings.cap, settings.track_memory)
        self._people = People(settings)
        self._heirs = Heirs(settings.continuity)
        self._corrections = Corrections()
        self._alignment = GroundAlignment(settings.trust_ground)
        self._last_frame: int | None = None

    def update(self, tracks: Sequence[LocalTrack], last_frame: int) -> IdentityUpdate:
        """Take in all cameras' tracks of the window that ends with `last_frame`.

        Call it once per solved window; windows may overlap. A track that is missing may come back.

        Raises:
            ValueError: frames that do not advance, or tracks that make no sense (see `line_up`).
        """
        if self._last_frame is not None and last_frame <= self._last_frame:
            raise ValueError(f"the update for frame {last_frame} comes after that for {self._last_frame}")
        given = line_up(tracks, self._homographies, last_frame, self._foot_error)
        seen = self._alignment.corrected(given)
        since = last_frame - seen.boxes.shape[1] if self._last_frame is None else self._last_frame
        self._last_frame = last_frame
        present = seen.present(since, last_frame)
        self._scale.learn(seen.heights)

        for key in seen.keys:
            self._people.meet(key, last_frame)
        rows = np.flatnonzero(present).tolist()
        places = seen.places(rows)
        self._gather(seen, present, last_frame)
        merged = self._regroup(seen, self._inherit(seen, present, places))
        serials = self._people.serials(seen.keys)
        self._alignment.learn(given, seen, serials, present, self._gate(), self._scale.height)
        self._remember({track.key: track for track in tracks}, [seen.keys[i] for i in rows], places)
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

    def _gather(self, seen: Sightings, present: NDArray[np.bool_], last_frame: int) -> None:
        """Count what this update says about pairs of tracks."""
        keys = self._people.tracks_heard_since(last_frame - self._settings.track_memory)
        self._pairs.follow(keys, np.array([self._camera[key.camera] for key in keys], dtype=np.int64))
        rows = self._pairs.rows(seen.keys)
        scores = Scores.joined([self._by_looks(seen, present), self._by_ground(seen, present, rows)])
        stands = seen.stands & present[:, None]
        self._pairs.add(last_frame, rows[scores.one], rows[scores.two], scores.score, rows, stands)
        for camera in seen.cameras():
            self._pairs.rivals.add(rows[camera], seen.side_by_side(camera))

    def _by_ground(self, seen: Sightings, present: NDArray[np.bool_], rows: NDArray[np.int64]) -> Scores:
        """Score the pairs of tracks that stand near each other, and those that something is known about."""
        on_ground = present & np.array(
            [self._homographies[key.camera] is not None for key in seen.keys], bool
        )
        return near_or_known(seen, on_ground, rows, self._pairs, self._gate())

    def _by_looks(self, seen: Sightings, present: NDArray[np.bool_]) -> Scores:
        """Score the pairs of tracks of two cameras that have no ground in common.

        Learns on the way how each camera renders people, and how much people differ.
        """
        looks = SettledLooks(self._appearances, self._people, seen, present)
        cameras = seen.cameras()
        # Who was seen side by side, back from the last camera to what is remembered of it.
        apart: list[NDArray[np.float64]] = []
        for rows in reversed(cameras):
            if sum(one.size for one in apart) < KNOWN_PAIRS:
                within = looks.unlike(rows, rows)
                apart.append(within[np.triu(seen.side_by_side(rows)) & ~np.isnan(within)])
        self._appearances.learn_different(np.concatenate([np.zeros(0), *reversed(apart)]))
        settings = self._settings
        return appearance_scores(
            cameras,
            [self._homographies[seen.keys[rows.start].camera] is not None for rows in cameras],
            looks.unlike,
            self._appearances.gate(settings.appearance_gate, settings.appearance_share),
        )

    def _inherit(
        self, seen: Sightings, present: NDArray[np.bool_], places: Sequence[tuple[Place, Place]]
    ) -> NDArray[np.bool_]:
        """Note who is whose heir; (T,) who of those present stays so: whoever has an heir now does not."""
        row_of = {seen.keys[i]: i for i in np.flatnonzero(present).tolist()}
        found = self._heirs.update(self._pairs.keys, dict(zip(row_of, places, strict=True)), seen.first)
        heirs, lost = (self._pairs.rows(keys) for keys in ([f.heir for f in found], [f.lost for f in found]))
        self._pairs.inherit(heirs, lost, self._settings.heir * np.array([f.score for f in found]))
        stays = present.copy()
        stays[[row_of[f.lost] for f in found if f.lost in row_of]] = False
        return stays

    def _regroup(self, seen: Sightings, present: NDArray[np.bool_]) -> tuple[Merge, ...]:
        """Group the tracks present into persons anew."""
        keys = self._pairs.keys
        here = np.zeros(len(keys), dtype=bool)
        here[self._pairs.rows(seen.keys)] = present
        if not here.any():
            return ()
        problem = GroupingProblem(
            pairs=self._pairs,
            person=self._people.serials(keys),
            present=here,
            hold=np.array([self._people.hold(key) for key in keys]),
            join=self._settings.join,
        )
        return self._people.regroup(self._pairs, group(problem), here)

    def _remember(
        self,
        given: Mapping[TrackKey, LocalTrack],
        keys: Sequence[TrackKey],
        places: Sequence[tuple[Place, Place]],
    ) -> None:
        """Write down where each person was seen, and how they looked."""
        looks = normalised([given[key].histogram for key in keys])
        counted: dict[int, Person] = {}
        for key, look, (first, last) in zip(keys, looks, places, strict=True):
            person = self._people.person(key)
            person.see(key, first, last)
            if look is not None:
                person.look(key.camera, look)
            counted[id(person)] = person
        for person in counted.values():
            person.updates += 1
