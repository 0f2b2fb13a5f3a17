"""The audio of one time-shift stream: gapless from the first picture on, from memory or the disk."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Sequence
from io import BufferedReader
from itertools import accumulate, pairwise
from pathlib import Path

from server.media.audio.audio_chunk import AudioChunk
from server.media.audio.audio_format import AudioFormat
from server.service.recording.media_files import run_in_reader_thread
from server.service.recording.segment_index import IndexEntry
from server.service.streaming.audio_buffer import AudioBuffer, AudioFollower
from server.service.streaming.gapless_timeline import LONGEST_GAP_S
from server.service.time_shift.playback import SessionEntries


class PlaybackAudio:
    """Finds audio in memory, else on the disk; missing audio is silent, late audio is waited for.

    ``recorded`` returns what is on the disk, ``end`` the pulse after the newest picture; without it no audio
    is waited for.
    """

    def __init__(
        self,
        buffer: AudioBuffer,
        recorded: Callable[[], Sequence[SessionEntries]],
        end: Callable[[], int] | None = None,
    ) -> None:
        self._buffer, self._recorded, self._end = buffer, recorded, end
        self._next: int | None = None
        self._follower: AudioFollower | None = None

    async def next_audio(self, first: int, until: int) -> AudioChunk:
        """Return the next audio frames, as the pulses ``first … until - 1`` are shown."""
        buffer = self._buffer
        audio_format = buffer.format
        begin, end = audio_format.frame_at(first, buffer.fps), audio_format.frame_at(until, buffer.fps)
        longest = audio_format.frame_at(round(LONGEST_GAP_S * buffer.fps), buffer.fps)
        if self._next is None or begin > self._next + longest:  # pictures do not fill such a gap either
            self._next = begin
        begin = self._next
        late = (
            end
            if self._end is None
            else audio_format.frame_at(self._end(), buffer.fps) - buffer.max_late_frames
        )
        frames = {number: buffer.get(number) for number in range(begin, end)}
        missing = [number for number, frame in frames.items() if frame is None]
        if missing and (recorded := self._recorded()):
            frames |= await run_in_reader_thread(self._read, recorded, missing[0], missing[-1] + 1)
        self._next = next(
            (number for number in missing if number >= late and frames[number] is None), max(begin, end)
        )
        audio = (frames[number] or audio_format.silence for number in range(begin, self._next))
        return AudioChunk(begin, tuple(audio), audio_format)

    def live(self, first: int, until: int) -> AudioChunk:
        """Return the next audio frames of the live stream: nothing is read from the disk any more."""
        if self._follower is None:
            self._follower = AudioFollower(self._buffer, self._next)
        return self._follower.next_audio(first, until)

    def _read(self, recorded: Sequence[SessionEntries], begin: int, end: int) -> dict[int, bytes]:
        audio_format, fps = self._buffer.format, self._buffer.fps
        frames: dict[int, bytes] = {}
        for recording in recorded:
            for entry in recording.index.between(*audio_format.pulses_of_frames(begin, end, fps)):
                frames |= _frames_of(recording, entry, begin, end, audio_format)
        return frames


def _frames_of(
    recorded: SessionEntries, entry: IndexEntry, begin: int, end: int, audio_format: AudioFormat
) -> dict[int, bytes]:
    path = recorded.session.paths.audio_file(entry.file)
    try:
        return read_audio_frames(path, entry.offset, entry.length, begin, end, audio_format)
    except OSError:  # deleted by retention, or not readable: silent
        return {}


_HEAD = 8
"""Bytes of a box's size and type."""


def read_audio_frames(
    path: Path, offset: int, length: int, begin: int, end: int, audio_format: AudioFormat
) -> dict[int, bytes]:
    """Read the frames ``begin … end - 1``, as far as they are in a piece of an audio file.

    Frames are numbered by their samples (:mod:`server.media.audio.audio_format`), the time of a fragment: so
    they are found by number alone.

    Raises:
        OSError: the file cannot be read: retention may have deleted it.
    """
    frames: dict[int, bytes] = {}
    with path.open("rb") as file:
        for sample, sizes, at in _fragments(file, offset, offset + length):
            number = sample // audio_format.samples
            if number >= end:
                break
            if number + len(sizes) <= begin:
                continue
            file.seek(at)
            data = file.read(sum(sizes))
            edges = pairwise(accumulate(sizes, initial=0))
            frames |= {number + place: data[edge:until] for place, (edge, until) in enumerate(edges)}
    return {number: data for number, data in frames.items() if begin <= number < end}


def _fragments(file: BufferedReader, at: int, end: int) -> Iterator[tuple[int, tuple[int, ...], int]]:
    """Yield each fragment's first sample, the sizes of its frames, and their offset."""
    moof = b""
    while at + _HEAD <= end:
        file.seek(at)
        head = file.read(_HEAD)
        if len(head) < _HEAD:
            return
        size, box_type = struct.unpack(">I4s", head)
        if not _HEAD <= size <= end - at:
            return
        if box_type == b"moof":
            moof = file.read(size - _HEAD)
        elif box_type == b"mdat" and (times := _times_of(moof)) is not None and sum(times[1]) <= size - _HEAD:
            yield *times, at + _HEAD
        at += size


def _times_of(moof: bytes) -> tuple[int, tuple[int, ...]] | None:
    """Return the first sample of a fragment and the sizes of its frames; None if it is damaged."""
    try:
        (sample,) = struct.unpack_from(">Q", moof, moof.index(b"tfdt") + 8)
        at = moof.index(b"trun") + 8
        (count,) = struct.unpack_from(">I", moof, at)
        return sample, struct.unpack_from(f">{count}I", moof, at + 8)
    except (ValueError, struct.error):
        return None
