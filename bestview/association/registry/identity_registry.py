"""The same number for the same person in every camera, for as long as anybody remembers."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestview.association.affinity.affinity_fusion import Weighing
from bestview.association.affinity.affinity_matrix import PairTables
from bestview.association.appearance.cross_camera import LooksBetween
from bestview.association.co_occurrence import Standing, at_once, near
from bestview.association.ghost_check import Doubt
from bestview.association.keys import EpisodeKey, TrackKey
from bestview.association.registry.corrections import Corrections, Merge, Split
from bestview.association.registry.people import People
from bestview.association.registry.track_swaps import exchange
from bestview.association.settings import IdentitySettings
from bestview.association.sightings import FootError, LocalTrack, Sightings, line_up
from bestview.association.tracklet_groups import Group, groups_of
from bestview.association.tracklet_splitter import Episodes
from bestview.geometry.ground_plane import validate_homography
from bestview.geometry.person_height import HeightScale


@dataclass(frozen=True, slots=True)
class IdentityUpdate:
    """Who is who after one update; every tuple is in rising order.

    Attributes:
        numbers: the person's number of each episode that may still change; 0: nobody's yet. A track is
            who its newest episode is that has begun.
        born: numbers given for the first time.
        returned: numbers of people who had gone and are back.
        gone: numbers of people whom no camera has seen for a while; they are remembered.
        merged: numbers that turned out to be one person.
        split: numbers that stood for somebody else than who was behind them before.
    """

    numbers: Mapping[EpisodeKey, int]
    born: tuple[int, ...]
    returned: tuple[int, ...]
    gone: tuple[int, ...]
    merged: tuple[Merge, ...]
    split: tuple[Split, ...]


class IdentityRegistry:
    """Joins the cameras' tracks into persons, update by update.

    Tracks are cut into episodes where they may have been confused (`Episodes`). Pairs of episodes gather
    evidence of being one person: where they stand, how they look, what goes on, what was told. Every few
    frames all episodes of the last seconds are grouped anew (`cluster`), such that two seen at once in one
    camera are two people, and the groups get the numbers that most of their frames were told to have. What
    is older is settled: it stays whose it was told to be, and speaks as one. Numbers count from 1 and are
    not used twice. Same updates, same numbers.

    Args:
        settings: see there.
        homographies: by camera name, image pixels -> common ground plane; None: not calibrated.
        overhead: the cameras that look straight down.
        fps: frames a second, by which it is known how far somebody can have walked.

    Raises:
        ValueError: a homography that is none.
    """

    def __init__(
        self,
        settings: IdentitySettings,
        homographies: Mapping[str, NDArray[np.float64] | None],
        overhead: Collection[str] = (),
        fps: float = 25.0,
    ) -> None:
        self._settings, self._overhead = settings, frozenset(overhead)
        self._foot_error = FootError(settings.foot_sideways, settings.foot_upwards)
        self._homographies = {
            camera: None if matrix is None else validate_homography(matrix, f"camera {camera}")
            for camera, matrix in sorted(homographies.items())
        }
        self._camera = {camera: i for i, camera in enumerate(self._homographies)}
        self._scale = HeightScale()
        calibrated = {camera: matrix is not None for camera, matrix in self._homographies.items()}
        self._between = LooksBetween(settings, calibrated)
        self._episodes = Episodes(settings)
        self._people = People(settings, len(self._homographies))
        # Who should be seen is only known of pictures in which people stand upright.
        self._doubt = Doubt(
            {it: None if it in self._overhead else matrix for it, matrix in self._homographies.items()}
        )
        self._pictures: Mapping[str, tuple[int, int]] = {}
        self._tables = PairTables(settings)
        self._weighing = Weighing(settings, calibrated, settings.maximum_speed_heights / fps)
        self._corrections = Corrections()
        self._here: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self._last_frame: int | None = None

    def update(
        self,
        tracks: Sequence[LocalTrack],
        last_frame: int,
        pictures: Mapping[str, tuple[int, int]] | None = None,
    ) -> IdentityUpdate:
        """Take in what is new and final of all cameras' tracks, by now up to `last_frame`.

        Single cameras may be ahead of it. A track that is missing may come back. `pictures` are the width and
        height in pixels of the cameras that have spoken, of somebody or of nobody: only these can be said not
        to see whom they should.

        Raises:
            ValueError: updates that do not advance, or tracks that make no sense (see `line_up`).
        """
        if self._last_frame is not None and last_frame <= self._last_frame:
            raise ValueError(f"the update for frame {last_frame} comes after that for {self._last_frame}")
        before, self._last_frame = self._last_frame, last_frame
        self._pictures = pictures or {}
        seen = line_up(tracks, self._homographies, self._foot_error, self._overhead)
        self._scale.learn(seen.heights)
        rows, firm = self._episodes.take(seen, {track.key: track.looks for track in tracks})
        self._here = np.unique(firm[firm > 0])
        # Each track and number once: there are as many sightings of them as frames.
        most = int(firm.max(initial=0)) + 1
        track, number = np.divmod(np.unique((np.arange(len(firm))[:, None] * most + firm)[firm > 0]), most)
        by = [seen.keys[it].camera for it in track.tolist()]
        self._people.see(zip(number.tolist(), by, strict=True), last_frame)
        self._gather(seen, rows, firm, last_frame)
        episodes = self._episodes.open
        born: tuple[int, ...] = ()
        merged: tuple[Merge, ...] = ()
        told: dict[EpisodeKey, int] = {}
        every = self._settings.clustering_interval
        anew = before is None or last_frame // every > before // every
        if anew:
            born, merged = self._regroup(last_frame)
            told = {
                it.key: it.number for it in episodes if it.tell(last_frame - self._settings.publish_after)
            }
        returned, gone = self._people.comings_and_goings(episodes, last_frame)
        split = self._corrections.update(told, merged)
        numbers = {episode.key: episode.number for episode in episodes}
        if anew:
            self._settle(last_frame)
        return IdentityUpdate(numbers, born, returned, gone, merged, split)

    def part(self, tracks: Collection[TrackKey], people: Collection[int]) -> int | None:
        """Take somebody's word that what these tracks show now is none of these people, but somebody new.

        It stays so: none of them is ever taken for the new person again, as long as they are remembered.

        Returns:
            The new person's number; None: none of the tracks is said to be any of these people now.
        """
        if self._last_frame is None:
            return None
        known = [number for number in sorted(people) if number in self._people]
        shown = self._episodes.shown(tracks, known)
        if not shown:
            return None
        new = self._people.part(known, {it.key.camera for it in shown}, self._last_frame)
        for episode in shown:
            episode.become(new)
        mine = {episode.key for episode in shown}
        rows = [it.key for it in self._episodes.open]
        others = [it.key for it in self._episodes.open if it.number in known and it.key not in mine]
        self._tables.make_room([new, *known])
        self._corrections.part(mine, new)
        self._tables.set_apart([new, *(it for it in rows if it in mine)], [*known, *others])
        return new

    def exchange(
        self, one: TrackKey, two: TrackKey, frame: int, numbers: tuple[int, int]
    ) -> tuple[Split, ...]:
        """Take somebody's word that in this frame two tracks of a camera took each other's person over.

        So from it on each goes on from what the other one was before; and whoever other cameras have since
        taken for them is taken for the other one of the two (`exchange`).

        Args:
            one: a track.
            two: another one.
            frame: the first in which each of them shows the other's person.
            numbers: of whom they showed before it, where that is settled and over.

        Returns:
            What has turned out about numbers: nothing where the evidence has told it already, or where one
            of them was nobody yet.
        """
        splits = exchange(self._episodes, self._people, (one, two), frame, numbers)
        self._corrections.part_each(splits)
        return tuple(sorted({Split(was, number, key.camera) for key, (was, number) in splits.items()}))

    @property
    def next_number(self) -> int:
        """The first number that nobody was given yet."""
        return self._people.next_number

    def begin_at(self, number: int) -> None:
        """Give no number below this one any more: an earlier run has given them."""
        self._people.begin_at(number)

    def recall(self, track: TrackKey, number: int, frame: int) -> None:
        """Take over whose a track is that is not heard of here yet, from a run that ended with a frame.

        It is evidence like anything that was told: what cameras show from now on may speak against it.
        """
        self._people.recall(number, frame)
        self._episodes.recall(track, number)

    @property
    def pairs(self) -> int:
        """How many pairs of parts of tracks and people there is anything to say of: what memory goes with."""
        return self._tables.entries

    def _gate(self) -> float:
        """Distance between feet at which they are as likely one person's as two's, ground units."""
        settings = self._settings
        return (
            settings.gate_distance
            if settings.gate_distance is not None
            else settings.gate_heights * self._scale.height
        )

    def _silent(self, group: Group) -> int:
        return self._doubt.silent(group, self._pictures, self._scale.height)

    def _gather(
        self, seen: Sightings, rows: NDArray[np.int64], firm: NDArray[np.int64], last_frame: int
    ) -> None:
        """Sum up what the update says about pairs of episodes."""
        past = [person.number for person in self._people.recent(last_frame)]
        tables = self._tables
        count = len(self._episodes.open)
        tables.arrange([*(episode.key for episode in self._episodes.open), *past])
        if past:
            # Who is settled though they go on has the row of their past.
            place = np.minimum(np.searchsorted(past, firm), len(past) - 1)
            rows = np.where(np.array(past)[place] == firm, count + place, rows)
        camera = np.array([self._camera[key.camera] for key in seen.keys], dtype=np.int64)
        tables.add_apart(*at_once(rows, camera))
        if self._gate() > 0:
            stands = Standing.of(seen, rows, camera)
            met = near(stands, self._gate(), count, tables.met(), len(tables))
            tables.add_near(met.one, met.two, met.score, met.frames)
            tables.stand(stands.rows, stands.frames)
        self._between.update(self._episodes.open, np.unique(rows[(rows >= 0) & (rows < count)]), tables)

    def _regroup(self, last_frame: int) -> tuple[tuple[int, ...], tuple[Merge, ...]]:
        """Say anew who is who; give the numbers of who is new, and what was merged."""
        episodes, past = self._episodes.open, self._people.recent(last_frame)
        here = np.isin([person.number for person in past], self._here)
        group = self._weighing.grouped(episodes, past, here, self._tables, self._scale.height)
        groups = groups_of(episodes, past, group)
        born, merged = self._people.name(groups, self._tables, self._between, last_frame, self._silent)
        self._tables.make_room(merge.kept for merge in merged)
        self._tables.absorb([(merge.kept, merge.lost) for merge in merged])
        for merge in merged:
            self._episodes.told_anew(merge.lost, merge.kept)
        return born, merged

    def _settle(self, last_frame: int) -> None:
        """Let go of what is old: it goes on as its person's past."""
        rows = self._episodes.old(last_frame)
        self._weighing.remember(rows, self._episodes.open, self._tables)
        old = [self._episodes.open[row] for row in rows]
        theirs = [(episode.mostly, episode.key) for episode in old if episode.mostly]
        self._tables.make_room(number for number, _ in theirs)
        self._tables.absorb(theirs)
        self._people.settle(old)
        self._episodes.settle(old, last_frame)
        self._people.forget(last_frame)
        self._corrections.keep_only({episode.key for episode in self._episodes.open})
