"""Repairs person numbers after a camera revised its past because two tracks had switched identities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from bestview import IdentityRegistry, Split, TrackKey
from server.service.identity.camera_window import CameraWindow, WindowReader
from server.service.identity.id_switches import find_id_switches
from server.service.identity.track_parts import UNCONFIRMED, UNKNOWN, TrackPart, person_numbers
from server.service.ingest.window_history import HistorySpan

Parts = dict[TrackKey, Sequence[TrackPart]]


class IdSwitchRepair:
    """Applies windows that revise the past: exchanges the keys of tracks that had switched.

    A key stands for one continuous path: where a camera's two tracks exchange people, their keys are
    exchanged here, so that earlier evidence stays valid. From then on their person numbers are fixed.
    """

    def __init__(self, registry: IdentityRegistry, reader: WindowReader) -> None:
        self._registry, self._reader = registry, reader
        self._switches: dict[TrackKey, TrackPart] = {}
        """By track, the number it has since a switch, until the registry no longer revises that time."""

    def read(
        self,
        window: CameraWindow,
        before: Sequence[HistorySpan[CameraWindow]],
        parts: Parts,
        needed_from: int,
    ) -> tuple[CameraWindow, list[Split]]:
        """Return the window with its tracks' current keys, and the splits that follow.

        ``before`` are the earlier windows of its final frames. ``parts``, each track's person numbers, is
        updated in place; for frames before ``needed_from`` it may be incomplete.
        """
        splits: list[Split] = []
        for one, two, frame in find_id_switches(window, before):
            first, second = (_person_at(parts.get(it, UNKNOWN), frame - 1, needed_from) for it in (one, two))
            self._reader.locals.exchange(one, two)
            splits += self._registry.swap_tracks(one, two, frame, (first, second))
            if first and second and first != second:
                self._switches |= {one: TrackPart(frame, second), two: TrackPart(frame, first)}
                self.overlay(parts)
        return self._reader.with_current_keys(window), splits

    def overlay(self, parts: Parts) -> None:
        """Override the registry's numbers with those fixed by a switch."""
        for key, since in self._switches.items():
            if key not in parts:
                continue
            later = [it for it in parts[key] if it.first > since.first]
            parts[key] = [*(it for it in parts[key] if it.first < since.first), since, *later]

    def merge(self, merged: Mapping[int, int]) -> None:
        """Replace merged numbers."""
        self._switches = {
            key: TrackPart(it.first, merged.get(it.number, it.number)) for key, it in self._switches.items()
        }

    def keep_only(self, parts: Parts, needed_from: int) -> None:
        """Drop switches before the frames that are still needed."""
        self._switches = {
            key: it
            for key, it in self._switches.items()
            if key in parts and not any(it.first < part.first <= needed_from for part in parts[key])
        }


def _person_at(parts: Sequence[TrackPart], frame: int, needed_from: int) -> int:
    """Return a track's person number in a frame, or in the first frame still known; 0: unconfirmed."""
    if frame < parts[0].first <= needed_from:
        frame = parts[0].first
    number = int(person_numbers([parts], frame, 1)[0, 0])
    return 0 if number == UNCONFIRMED else number
