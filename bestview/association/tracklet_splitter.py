"""Tracks in parts that are surely one person: cut where a tracker may have taken one for another.

A tracker confuses people where they hide each other, hardly ever elsewhere. Whoever comes out of a crowd,
or comes back after a while unseen, begins a new episode: who it is, is asked anew.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from bestview.association.appearance.mean_histograms import Look
from bestview.association.keys import EpisodeKey, TrackKey
from bestview.association.runs import runs_of
from bestview.association.settings import IdentitySettings
from bestview.association.sightings import Glimpse, Sightings
from bestview.association.tracklet import End, Episode

Floats = NDArray[np.float64]

_ROOTED = 4
"""Frames outside crowds that an episode needs before the next crowd can end it."""
_SURE = 2
"""Groupings for which an episode must have been told one number to be settled while it goes on."""


class Episodes:
    """Cuts every camera's tracks into episodes as they come in.

    Attributes:
        open: those that are not settled yet, in the order in which they were heard of: the rows of what
            others keep about them.
    """

    def __init__(self, settings: IdentitySettings) -> None:
        self._settings = settings
        self.open: list[Episode] = []
        self._current: dict[TrackKey, Episode] = {}
        self._row: dict[EpisodeKey, int] = {}
        self._cut: dict[TrackKey, tuple[int, Episode]] = {}
        """Tracks whose next sighting is said to begin an episode: whose it is, and what was before it."""
        self._recalled: dict[TrackKey, int] = {}
        """Tracks that were told to be somebody's before they were first heard of here."""

    def take(
        self, seen: Sightings, looks: Mapping[TrackKey, Sequence[Glimpse]]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Take in an update.

        Args:
            seen: the tracks.
            looks: how they look; in a crowd that does not count.

        Returns:
            (T, W) the row in `open` that each sighting belongs to, -1: none; (T, W) the number of the person
            that it is settled to be, 0: it is not.
        """
        rows, firm = np.full(seen.visible.shape, -1), np.zeros(seen.visible.shape, dtype=np.int64)
        crowded = seen.crowded(self._settings.crowd_iou)
        # Where this is 0, a run of one frame is as good as a longer one.
        whole = min(self._settings.crowd_frames, self._settings.gap_frames) > 0
        for run in runs_of(seen.visible, crowded, whole=whole):
            key = seen.keys[run.track]
            episode, frame = self._current.get(key), seen.first + run.start
            if key in self._cut:
                number, before = self._cut.pop(key)
                episode = self._begin(key, _end(seen, run.track, run.start), before)
                episode.goes_on_as(number, before)
            elif episode is None or self._ends(episode, frame, crowded=run.crowded):
                episode = self._begin(key, _end(seen, run.track, run.start), episode)
                if key in self._recalled:
                    episode.become(self._recalled.pop(key))
            episode.sight(range(frame, seen.first + run.stop), crowded=run.crowded)
            episode.end = _end(seen, run.track, run.stop - 1)
            rows[run.track, run.start : run.stop] = self._row.get(episode.key, -1)
            firm[run.track, run.start : run.stop] = episode.firm
            for look in looks.get(key, ()):
                first, last = look.first - seen.first, look.last - seen.first
                if run.start <= last < run.stop and not crowded[run.track, first : last + 1].any():
                    episode.looks.add(key.camera, Look.of(look.histogram, last - first + 1))
        return rows, firm

    def _begin(self, key: TrackKey, at: End, before: Episode | None) -> Episode:
        episode = Episode(
            EpisodeKey(*key, at.frame), at, at, before, before.crowd if before is not None else 0
        )
        self._current[key] = episode
        self._row[episode.key] = len(self.open)
        self.open.append(episode)
        return episode

    def _ends(self, episode: Episode, frame: int, *, crowded: bool) -> bool:
        """Say whether a sighting in `frame` begins a new episode.

        Where it is neither known how somebody looks nor where they stand, there is nothing to ask by: the
        tracker is believed.
        """
        if not episode.looks.by_camera and np.isnan(episode.end.ground).any():
            return False
        settings = self._settings
        out_of_crowd = not crowded and episode.crowd >= settings.crowd_frames and episode.free >= _ROOTED
        return out_of_crowd or frame - episode.end.frame > settings.gap_frames

    def shown(self, tracks: Iterable[TrackKey], people: Collection[int]) -> list[Episode]:
        """Give what these tracks show now where it is one of these people, in the tracks' order."""
        now = [self._current[key] for key in sorted(set(tracks)) if key in self._current]
        return [it for it in now if (it.firm or it.number) in people]

    def before(self, track: TrackKey, frame: int, number: int) -> Episode | None:
        """Give the newest episode of a track that began before a frame; None: the track is not known.

        Of what is settled and over nothing is kept but whose it was, which is to be given.
        """
        mine = [it for it in self.open if it.key.track == track and it.begin.frame < frame]
        now = self._current.get(track)
        if mine or now is None or now.begin.frame < frame:
            return mine[-1] if mine else now
        over = End(frame - 1, now.begin.box, now.begin.ground)
        return Episode(EpisodeKey(*track, frame - 1), over, over, number=number, firm=number)

    def since(self, track: TrackKey, frame: int) -> Episode | None:
        """Give the newest episode of a track, if it is not settled and began in this frame or later."""
        now = self._current.get(track)
        return now if now is not None and not now.firm and now.begin.frame >= frame else None

    def cut(self, track: TrackKey, number: int, before: Episode) -> None:
        """Let a track's next sighting begin an episode of this person, which goes on from another one."""
        self._cut[track] = number, before

    def recall(self, track: TrackKey, number: int) -> None:
        """Let the first sighting of a track begin an episode that was told to be this person's."""
        if track not in self._current:
            self._recalled[track] = number

    def told_anew(self, lost: int, kept: int) -> None:
        """Take over that two numbers turned out to be one person's."""
        for episode in chain(self.open, self._current.values()):
            episode.told_anew(lost, kept)
            episode.firm = kept if episode.firm == lost else episode.firm
        for track, (number, before) in self._cut.items():
            self._cut[track] = kept if number == lost else number, before
        self._recalled = {it: kept if number == lost else number for it, number in self._recalled.items()}

    def old(self, last_frame: int) -> list[int]:
        """Give the rows of episodes that are old enough to be settled by now, in order.

        Where more than `most` are open, those that are unseen for longest are settled sooner, but not before
        they can have been told.
        """
        settings = self._settings
        ends = np.array([episode.end.frame for episode in self.open], dtype=np.int64)
        longest = np.argsort(ends, kind="stable")[: max(0, len(ends) - settings.maximum_open_tracklets)]
        soonest = last_frame - settings.publish_after - 2 * settings.clustering_interval
        old = ends <= last_frame - settings.settle_after
        old[longest[ends[longest] <= soonest]] = True
        over = len(ends) - int(old.sum()) - settings.maximum_open_tracklets
        if over > 0:
            # Still too many: whoever has been one person for longest stays it until the next crowd.
            sure = [it.told.get(it.number, 0) if it.number == it.mostly else 0 for it in self.open]
            surest = np.argsort(-np.where(old, 0, sure), kind="stable")[:over]
            old[surest[np.array(sure)[surest] >= _SURE * settings.clustering_interval]] = True
        return [int(row) for row in np.flatnonzero(old)]

    def settle(self, old: Iterable[Episode], last_frame: int) -> None:
        """Let go of episodes, of those that go on only as rows; the rows of the others move up."""
        oldest = last_frame - self._settings.settle_after
        closed = {episode.key for episode in old}
        for episode in self.open:
            if episode.key in closed:
                episode.before = None  # or all there ever was would be kept
                episode.firm, episode.untold = episode.mostly, []
        self.open = [episode for episode in self.open if episode.key not in closed]
        self._row = {episode.key: row for row, episode in enumerate(self.open)}
        # Tracks are not cut because they were settled; but who was nobody, or is long gone, begins anew.
        self._current = {
            key: it
            for key, it in self._current.items()
            if it.key in self._row or (it.firm and it.end.frame > oldest)
        }
        self._cut = {key: it for key, it in self._cut.items() if key in self._current}


def _end(seen: Sightings, track: int, column: int) -> End:
    # Copies: an end is remembered for long, and must not keep a whole update.
    return End(seen.first + column, seen.boxes[track, column].copy(), seen.ground[track, column].copy())
