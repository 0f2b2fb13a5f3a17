"""A file per person: the best view, spliced, from the first sighting to the last."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from server.view.agreement import Agreement
from server.view.decide import GopDecision
from server.view.shelf import Shelf
from server.wire.sections import Site


@dataclass(slots=True)
class _Film:
    file: BinaryIO
    origin: int
    """The pulse that is at time 0."""
    wanted: int
    """Bytes up to the end of the last GOP in which the person was about."""
    until: int
    """The pulse after it."""


class Films:
    """Writes ``object-1.mp4`` (or ``.webm``) and so on; the fragments of the streams, begun at time 0."""

    def __init__(self, folder: Path, shelves: Mapping[str, Shelf], agreement: Agreement, site: Site) -> None:
        folder.mkdir()
        self._folder, self._shelves, self._agreement, self._site = folder, shelves, agreement, site
        self._films: dict[int, _Film] = {}

    @property
    def numbers(self) -> list[int]:
        """Everybody who has a film."""
        return sorted(self._films)

    def write(self, decision: GopDecision) -> None:
        """Append one GOP to everybody's film."""
        for choice in decision.choices:
            if choice.camera is None:
                continue
            film = self._films.get(choice.number)
            if film is None:
                film = self._films[choice.number] = self._begin(choice.number, decision.first)
            shelf = self._shelves[choice.camera]
            for pulse in range(decision.first, decision.first + decision.frames):
                frame = shelf.get(pulse)
                if frame is not None:
                    begun = self._agreement.begun_at(film.origin, frame.fragment, self._site.fps)
                    film.file.write(begun)
            if not choice.away:
                film.wanted, film.until = film.file.tell(), decision.first + decision.frames

    def close(self) -> None:
        """Cut off what was shown after a person had left for good, and close the files."""
        for film in self._films.values():
            if not film.file.closed:
                film.file.truncate(film.wanted)
                film.file.seek(0)
                film.file.write(self._head(film.until - film.origin))
                film.file.close()

    def _begin(self, number: int, pulse: int) -> _Film:
        file = (self._folder / f"object-{number}.{self._agreement.container}").open("wb")
        file.write(self._head(0))
        return _Film(file, pulse, file.tell(), pulse)

    def _head(self, pulses: int) -> bytes:
        return self._agreement.head(self._site, pulses=pulses) or b""
