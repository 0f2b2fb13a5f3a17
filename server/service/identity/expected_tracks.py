"""Tracks that are expected to appear, and who they were in an earlier run of the service."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from server.service.identity.local_numbers import TrackName


class ExpectedTracks:
    """The tracks that have not appeared yet."""

    def __init__(self) -> None:
        self._people: dict[TrackName, tuple[int, int]] = {}

    def add(self, people: Mapping[TrackName, int], last_pulse: int) -> None:
        """Expect tracks of these people, by number, of a run that ended with `last_pulse`."""
        self._people |= {track: (number, last_pulse) for track, number in people.items()}

    def cancel(self, tracks: Iterable[TrackName]) -> None:
        """Expect these tracks no longer: if they appear, they are new people."""
        for track in tracks:
            self._people.pop(track, None)

    def forget(self, numbers: Collection[int]) -> None:
        """Expect no tracks of these people."""
        self._people = {track: of for track, of in self._people.items() if of[0] not in numbers}

    def take(self, track: TrackName) -> tuple[int, int] | None:
        """Return who a track was that has appeared, and the last pulse of that run; None: it is new."""
        return self._people.pop(track, None)
