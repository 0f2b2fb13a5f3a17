"""Who is who: from every camera's own track numbers to one number per person."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from bestview import IdentityRegistry, IdentitySettings, Merge, Split, TrackKey
from server.view.align import Epoch
from server.view.history import History
from server.view.numbered import numbered_boxes
from server.view.reading import CameraWindow, Reader
from server.view.share import served
from server.wire.config import Share
from server.wire.fit import Fit
from server.wire.messages import NumberedBox

ALL = Share()
"""One service for everybody."""

NOBODY_YET = -1
"""Stands for a person's number where a track is not confirmed to be anybody."""


class People:
    """Joins the cameras' tracks epoch by epoch, and remembers who was where.

    ``homographies`` map each camera's own picture to the ground; None where there is none. ``share`` says
    whom this service decides for; who is who is worked out for everybody, the same in every service.
    """

    def __init__(
        self,
        settings: IdentitySettings,
        cameras: Sequence[str],
        homographies: Mapping[str, NDArray[np.float64] | None],
        site_size: tuple[int, int],
        share: Share = ALL,
    ) -> None:
        self._registry = IdentityRegistry(settings, homographies)
        self._remembered = settings.forget_after
        self._share = share
        self._histories = {camera: History[CameraWindow]() for camera in cameras}
        self._reader = Reader(site_size)
        self._numbers: dict[TrackKey, int] = {}
        self._heard: dict[TrackKey, int] = {}
        self._unnamed: dict[TrackKey, int] = {}
        """Tracks that are nobody's yet, and since when they have been seen."""
        self.first_seen: dict[int, int] = {}
        self.last_seen: dict[int, int] = {}
        self.away: set[int] = set()
        """Those whom no camera has seen for a while; they are remembered."""
        self.merged: dict[int, int] = {}
        """Numbers that turned out to be another's."""
        self._corrections: list[Merge | Split] = []

    def update(self, epoch: Epoch) -> Sequence[CameraWindow]:
        """Take over what all cameras said about an epoch; give it as it was read."""
        windows = self._reader.read(epoch)
        for window in windows:
            self._histories[window.message.camera].put(window, window.first, window.message.last)
        tracks = [track for window in windows for track in window.local_tracks()]
        update = self._registry.update(tracks, epoch.last)
        keys = [key for window in windows for key in window.keys]
        for key in keys:
            # Who has left a person for one not confirmed yet has no number for now.
            self._numbers.pop(key, None)
        self._numbers.update(update.numbers)
        seen = chain.from_iterable(window.seen() for window in windows)
        for key, (first, last) in zip(keys, seen, strict=True):
            self._heard[key] = epoch.last
            self._note_seen(key, first, last)
        self.away = (self.away | set(update.gone)) - set(update.returned)
        for merge in update.merged:
            self._merge(merge.kept, merge.lost)
        self._corrections += [*update.merged, *update.split]
        self._forget(epoch.last)
        return windows

    @property
    def fits(self) -> Mapping[str, Fit]:
        """How each camera's own picture lies in the site's; known from its first word on."""
        return self._reader.fits

    @property
    def known(self) -> list[int]:
        """Everybody's number whom this service decides for, in order; those who are away too."""
        return served(sorted(self.first_seen), self.merged, self._share)

    @property
    def elsewhere(self) -> list[int]:
        """The other people's numbers, in order: another service decides for them."""
        mine = set(self.known)
        return [number for number in sorted(self.first_seen) if number not in mine]

    def number(self, camera: str, local: int, pulse: int) -> int | None:
        """Give the person's number behind a camera's local one in a frame; None while it is not confirmed."""
        number = int(self.numbers([TrackKey(camera, local)], pulse, 1)[0, 0])
        return None if number == NOBODY_YET else number

    def boxes(self, camera: str, first: int, frames: int) -> list[list[NumberedBox]]:
        """Give everybody's box in each of a camera's frames from `first` on, in the numbers' order."""
        told = self._histories[camera].over(first, first + frames - 1)
        return numbered_boxes(told, self.numbers, first, frames)

    def whose(self, camera: str, boot: int, track: int, pulse: int) -> int | None:
        """Give the person's number behind a tracker's number in a frame."""
        key = self._reader.locals.known(camera, boot, track)
        return None if key is None else self.number(key.camera, key.local, pulse)

    def numbers(self, keys: Sequence[TrackKey], first: int, frames: int) -> NDArray[np.int64]:
        """Give the persons' numbers behind T tracks, frame by frame, (T, frames); -1: nobody yet."""
        del first  # a track is one person's for as long as it is known
        known = self._numbers
        numbers = np.fromiter((known.get(key, NOBODY_YET) for key in keys), dtype=np.int64, count=len(keys))
        return np.broadcast_to(numbers[:, None], (len(keys), frames))

    def also(self, number: int) -> list[int]:
        """Give the other numbers that somebody once had, in order."""
        return sorted(old for old, new in self.merged.items() if new == number)

    def take_corrections(self) -> tuple[Merge | Split, ...]:
        """Give what has turned out about numbers since this was last asked, in order."""
        taken, self._corrections = tuple(self._corrections), []
        return taken

    def forget_boxes_before(self, pulse: int) -> None:
        """Let go of the boxes before a pulse."""
        for history in self._histories.values():
            history.forget_before(pulse)

    def _note_seen(self, key: TrackKey, first: int, last: int) -> None:
        if last < first:
            return
        number = self._numbers.get(key)
        if number is None:
            self._unnamed.setdefault(key, first)
            return
        # Who is confirmed now was there before: frames that are not decided yet can still show them.
        first = self._unnamed.pop(key, first)
        self.first_seen[number] = min(first, self.first_seen.get(number, first))
        self.last_seen[number] = max(last, self.last_seen.get(number, last))

    def _merge(self, kept: int, lost: int) -> None:
        self.merged = {old: kept if new == lost else new for old, new in self.merged.items()} | {lost: kept}
        self._numbers = {key: kept if number == lost else number for key, number in self._numbers.items()}
        first, last = self.first_seen.pop(lost, None), self.last_seen.pop(lost, None)
        self.away.discard(lost)
        if first is not None and last is not None:
            self.first_seen[kept] = min(first, self.first_seen.get(kept, first))
            self.last_seen[kept] = max(last, self.last_seen.get(kept, last))

    def _forget(self, now: int) -> None:
        """Let go of tracks and people that were not heard of for as long as the registry remembers."""
        for key in [key for key, heard in self._heard.items() if heard < now - self._remembered]:
            del self._heard[key]
            self._numbers.pop(key, None)
            self._unnamed.pop(key, None)
            self._reader.locals.forget(key)
        for number in [number for number, last in self.last_seen.items() if last < now - self._remembered]:
            del self.first_seen[number], self.last_seen[number]
            self.away.discard(number)
            self.merged = {old: new for old, new in self.merged.items() if new != number}
