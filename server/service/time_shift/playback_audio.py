"""What one viewer of the past hears: unbroken from the first picture on, whatever is shown of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from server.media.audio.audio_chunk import AudioChunk
from server.media.audio.audio_format import AudioFormat
from server.service.recording.audio_file import read_audio_frames
from server.service.recording.media_files import run_in_reader_thread
from server.service.recording.segment_index import IndexEntry
from server.service.streaming.audio_buffer import AudioBuffer, AudioFollower
from server.service.streaming.gapless_timeline import LONGEST_GAP_S
from server.service.time_shift.playback import SessionEntries


class PlaybackAudio:
    """Finds sound in memory, else on the disk; what was not kept is silent, what may come yet is waited for.

    ``recorded`` gives what there is on the disk, ``now`` the pulse after the newest frame of the pictures;
    without it nothing is waited for.
    """

    def __init__(
        self,
        buffer: AudioBuffer,
        recorded: Callable[[], Sequence[SessionEntries]],
        now: Callable[[], int] | None = None,
    ) -> None:
        self._shelf, self._recorded, self._now = buffer, recorded, now
        self._next: int | None = None
        self._live: AudioFollower | None = None

    async def beside(self, first: int, until: int) -> AudioChunk:
        """Give what follows what was heard, now that the pulses ``first … until - 1`` are shown."""
        buffer = self._shelf
        form = buffer.format
        begin, end = form.frame_at(first, buffer.fps), form.frame_at(until, buffer.fps)
        longest = form.frame_at(round(LONGEST_GAP_S * buffer.fps), buffer.fps)
        if self._next is None or begin > self._next + longest:  # nor is such a hole bridged by pictures
            self._next = begin
        begin = self._next
        late = end if self._now is None else form.frame_at(self._now(), buffer.fps) - buffer.max_late_frames
        frames = {number: buffer.get(number) for number in range(begin, end)}
        missing = [number for number, frame in frames.items() if frame is None]
        if missing and (recorded := self._recorded()):
            frames |= await run_in_reader_thread(self._read, recorded, missing[0], missing[-1] + 1)
        self._next = next((it for it in missing if it >= late and frames[it] is None), max(begin, end))
        heard = (frames[number] or form.silence for number in range(begin, self._next))
        return AudioChunk(begin, tuple(heard), form)

    def live(self, first: int, until: int) -> AudioChunk:
        """Go on with the present: nothing is looked up any more."""
        if self._live is None:
            self._live = AudioFollower(self._shelf, self._next)
        return self._live.next_audio(first, until)

    def _read(self, recorded: Sequence[SessionEntries], begin: int, end: int) -> dict[int, bytes]:
        form, fps = self._shelf.format, self._shelf.fps
        found: dict[int, bytes] = {}
        for one in recorded:
            for it in one.tape.between(*form.pulses(begin, end, fps)):
                found |= _frames_of(one, it, begin, end, form)
        return found


def _frames_of(
    recorded: SessionEntries, stretch: IndexEntry, begin: int, end: int, form: AudioFormat
) -> dict[int, bytes]:
    path = recorded.run.sound_file(stretch.file)
    try:
        return read_audio_frames(path, stretch.offset, stretch.length, begin, end, form)
    except OSError:  # retention has just taken it away, or it cannot be read: it is silent
        return {}
