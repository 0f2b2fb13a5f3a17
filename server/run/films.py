"""A file per person: the best view, spliced, from the first sighting to the last."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from server.view.agreement import Agreement
from server.view.decide import GopDecision
from server.view.fmp4 import init_segment, rebased, ticks
from server.view.shelf import Shelf
from server.wire.sections import Site


@dataclass(slots=True)
class _Film:
    file: BinaryIO
    origin: int
    """The pulse that is at time 0."""
    wanted: int
    """Bytes up to the end of the last GOP in which the person was about."""


class Films:
    """Writes ``object-1.mp4`` and so on; the same fragments as live, moved to begin at time 0."""

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
            by = -ticks(film.origin, self._site.fps)
            for pulse in range(decision.first, decision.first + decision.frames):
                frame = shelf.get(pulse)
                if frame is not None:
                    film.file.write(rebased(frame.fragment, by))
            if not choice.away:
                film.wanted = film.file.tell()

    def close(self) -> None:
        """Cut off what was shown after a person had left for good, and close the files."""
        for film in self._films.values():
            if not film.file.closed:
                film.file.truncate(film.wanted)
                film.file.close()

    def _begin(self, number: int, pulse: int) -> _Film:
        file = (self._folder / f"object-{number}.mp4").open("wb")
        parameters = self._agreement.parameters
        if parameters is not None:
            file.write(init_segment(parameters, self._site.width, self._site.height))
        return _Film(file, pulse, file.tell())
