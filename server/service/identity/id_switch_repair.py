"""Numbers follow the people where a camera's past was mended: its tracks had taken them for each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from bestview import IdentityRegistry, Split, TrackKey
from server.service.identity.camera_window import CameraWindow, WindowReader
from server.service.identity.id_switches import find_id_switches
from server.service.identity.track_parts import NOBODY_YET, UNKNOWN, TrackPart, person_numbers
from server.service.ingest.window_history import HistorySpan

Parts = dict[TrackKey, Sequence[TrackPart]]


class IdSwitchRepair:
    """Applies windows whose past was corrected.

    A track is what goes its way without a jump: where a camera's two tracks exchange their people, they
    exchange their names here, and what is known of them stays true. Whose they are from then on is said.
    """

    def __init__(self, registry: IdentityRegistry, reader: WindowReader) -> None:
        self._registry, self._reader = registry, reader
        self._switches: dict[TrackKey, TrackPart] = {}
        """Since when a track is whose, until the evidence speaks of that time no more."""

    def read(
        self,
        window: CameraWindow,
        before: Sequence[HistorySpan[CameraWindow]],
        parts: Parts,
        needed_from: int,
    ) -> tuple[CameraWindow, list[Split]]:
        """Return a window by what its tracks are called now, and what has turned out about numbers.

        ``before`` is what was said of its frames that were final; ``parts``, whose tracks are, is changed:
        of frames before ``asked_from`` it may be forgotten.
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
        """Put what was said of tracks over what is worked out."""
        for key, since in self._switches.items():
            if key not in parts:
                continue
            later = [it for it in parts[key] if it.first > since.first]
            parts[key] = [*(it for it in parts[key] if it.first < since.first), since, *later]

    def merge(self, merged: Mapping[int, int]) -> None:
        """Take over that numbers are another's now."""
        self._switches = {
            key: TrackPart(it.first, merged.get(it.number, it.number)) for key, it in self._switches.items()
        }

    def keep_only(self, parts: Parts, needed_from: int) -> None:
        """Forget what nobody asks for any more."""
        self._switches = {
            key: it
            for key, it in self._switches.items()
            if key in parts and not any(it.first < part.first <= needed_from for part in parts[key])
        }


def _person_at(parts: Sequence[TrackPart], frame: int, needed_from: int) -> int:
    """Return whose a track was in a frame, 0: nobody's; where that is forgotten, in the first that is not."""
    if frame < parts[0].first <= needed_from:
        frame = parts[0].first
    number = int(person_numbers([parts], frame, 1)[0, 0])
    return 0 if number == NOBODY_YET else number
