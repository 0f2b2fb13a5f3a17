"""Films of a rendering: one file per person with the spliced best view, from first to last sighting.

A number that turned out to be another person's has a film of its own only where that person's film lacks
some of its sightings.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from bestview import Merge
from server.config.sections import SiteSettings
from server.media.audio.audio_chunk import AudioChunk
from server.media.containers.mp4_audio import audio_fragment
from server.media.stream_format import StreamFormat
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.gapless_timeline import GaplessTimeline
from server.service.streaming.media_chunk import MediaChunk
from server.service.streaming.spliced_stream import GopAssembler, GopSequencer
from server.service.view_selection.decider import GopDecision


@dataclass(slots=True)
class _Film:
    file: BinaryIO
    showing: GopSequencer
    origin: int
    """The pulse at time 0."""
    trimmed_size: int
    """Bytes up to the end of the last GOP in which the person was present."""
    until: int
    """The pulse after it."""


class CorrectedNumbers:
    """Collects which numbers turned out to be another person's.

    They were merged, or split in all cameras that saw them, and not seen since.
    """

    def __init__(self) -> None:
        self._seen: defaultdict[int, set[int]] = defaultdict(set)
        """Of each number the first pulses of the GOPs in which cameras see the person."""
        self._unsplit: defaultdict[int, set[str]] = defaultdict(set)
        """Of each number the cameras that saw it and have not split it since."""
        self._successor: dict[int, int] = {}

    def add(self, decision: GopDecision) -> None:
        """Add the sightings and corrections of a decision."""
        for camera, frames in decision.boxes.items():
            for number in {number for boxes in frames for number, *_ in boxes}:
                self._seen[number].add(decision.first)
                self._unsplit[number].add(camera)
                self._successor.pop(number, None)
        for correction in decision.corrections:
            if isinstance(correction, Merge):
                self._successor[correction.lost] = correction.kept
                self._unsplit[correction.lost].clear()
            else:
                self._successor[correction.published_id] = correction.corrected_id
                self._unsplit[correction.published_id].discard(correction.camera)

    def corrected(self) -> dict[int, int]:
        """Return the number that replaces each number whose sightings are all in GOPs with the other's."""
        replaced = {}
        for number in sorted(self._successor):
            last, chain = number, {number}
            while not self._unsplit[last] and self._successor.get(last, last) not in chain:
                last = self._successor[last]
                chain.add(last)
            if last != number and self._seen[number] <= self._seen[last]:
                replaced[number] = last
        return replaced


class FilmWriter:
    """Writes a file ``object-K.mp4`` (or ``.webm``) per person: the stream's fragments, rebased to time 0.

    ``sound``: None if the site has none.
    """

    def __init__(
        self,
        folder: Path,
        frame_buffers: Mapping[str, FrameBuffer],
        stream_format: StreamFormat,
        site: SiteSettings,
        sound: AudioBuffer | None = None,
    ) -> None:
        folder.mkdir()
        self._folder, self._frame_buffers, self._stream_format, self._site = (
            folder,
            frame_buffers,
            stream_format,
            site,
        )
        self._sound = sound
        self._films: dict[int, _Film] = {}
        self._corrected = CorrectedNumbers()

    @property
    def numbers(self) -> list[int]:
        """Numbers of all people who have a film."""
        return sorted(set(self._films) - set(self.corrected))

    @property
    def corrected(self) -> dict[int, int]:
        """The numbers without a film of their own, with the numbers whose films show the same person."""
        return self._corrected.corrected()

    def write(self, decision: GopDecision) -> None:
        """Append one GOP to all films."""
        self._corrected.add(decision)
        gop = GopAssembler(
            self._frame_buffers, decision.first, decision.frames, self._site.fps, 0, self._sound
        )
        for choice in decision.choices:
            film = self._films.get(choice.number)
            if film is None and choice.camera is None:
                continue
            if film is None:
                film = self._films[choice.number] = self._begin(choice.number, decision)
            for chunk in film.showing.show(choice.camera, gop):
                self._write(film, chunk)
            if not choice.departed:
                film.trimmed_size, film.until = film.file.tell(), decision.first + decision.frames

    def close(self) -> None:
        """Truncate each film after the last GOP with its person, close the files, delete those of no use."""
        corrected = self.corrected
        for number, film in self._films.items():
            if film.file.closed:
                continue
            film.file.truncate(film.trimmed_size)
            film.file.seek(0)
            film.file.write(self._head(film.until - film.origin))
            film.file.close()
            if number in corrected:
                self._path(number).unlink()

    def _begin(self, number: int, decision: GopDecision) -> _Film:
        file = self._path(number).open("wb")
        file.write(self._head(0))
        showing = GopSequencer(GaplessTimeline(self._stream_format, self._site.fps, decision.frames))
        return _Film(file, showing, decision.first, file.tell(), decision.first)

    def _path(self, number: int) -> Path:
        return self._folder / f"object-{number}.{self._stream_format.container}"

    def _write(self, film: _Film, chunk: MediaChunk) -> None:
        if chunk.audio is not None:
            film.file.write(_rebased_audio(film.origin, chunk.audio, self._site.fps))
        for picture in chunk.pictures:
            film.file.write(self._stream_format.rebase(film.origin, picture.fragment, self._site.fps))

    def _head(self, pulses: int) -> bytes:
        sound = None if self._sound is None else self._sound.format
        return self._stream_format.init_segment(self._site.size, self._site.fps, sound, pulses=pulses) or b""


def _rebased_audio(origin: int, audio: AudioChunk, fps: float) -> bytes:
    """Return an audio fragment with times relative to the film's first pulse; earlier frames are dropped."""
    form = audio.format
    sample = round(origin * form.rate / fps)
    dropped = max(0, -((audio.first * form.samples - sample) // form.samples))
    first, frames = audio.first + dropped, audio.frames[dropped:]
    return audio_fragment(form, frames, first, sample) if frames else b""
