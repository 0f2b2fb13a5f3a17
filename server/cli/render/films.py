"""Films of a rendering: one file per person with the spliced best view, from first to last sighting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

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

    @property
    def numbers(self) -> list[int]:
        """Numbers of all people who have a film."""
        return sorted(self._films)

    def write(self, decision: GopDecision) -> None:
        """Append one GOP to all films."""
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
        """Truncate each film after the last GOP with its person, and close the files."""
        for film in self._films.values():
            if not film.file.closed:
                film.file.truncate(film.trimmed_size)
                film.file.seek(0)
                film.file.write(self._head(film.until - film.origin))
                film.file.close()

    def _begin(self, number: int, decision: GopDecision) -> _Film:
        file = (self._folder / f"object-{number}.{self._stream_format.container}").open("wb")
        file.write(self._head(0))
        showing = GopSequencer(GaplessTimeline(self._stream_format, self._site.fps, decision.frames))
        return _Film(file, showing, decision.first, file.tell(), decision.first)

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
