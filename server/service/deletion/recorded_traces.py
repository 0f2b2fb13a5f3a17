"""What the recording holds about a person: their numbers, and when they were visible in which cameras."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from server.service.deletion.decision_rows import decisions_with, is_about, mention_pattern
from server.service.recording.person_removal import SegmentFile, check_in_place
from server.service.recording.playlist_file import RecordingPlaylist
from server.service.recording.recording_session import RecordingSession
from server.service.recording.segment_index import PulseRange, merge_pulse_ranges
from server.service.recording.session_files import AUDIO

MARGIN_S = 1.0
"""Seconds before the first and after the last box in which somebody may be visible without one."""
_GAP_S = 3.0
"""Seconds without a box for which somebody counts as visible: hidden for a moment."""
_HAS_MERGE = re.compile(rb'"merged":\[\{')


@dataclass(slots=True)
class SessionTraces:
    """A person's traces in one session of the recording."""

    session: RecordingSession
    gops: int = 0
    """Decisions that mention them."""
    visible: dict[str, list[PulseRange]] = field(default_factory=dict)
    """By camera, when it saw them, with a margin."""
    files: frozenset[SegmentFile] = frozenset()
    """The files of video and sound that hold these times."""
    lost: dict[str, int] = field(default_factory=dict)
    """Frames in these files: by camera, and of the sound (`AUDIO`)."""
    lost_by_others: dict[int, int] = field(default_factory=dict)
    """Frames in these files that are in the best views of other people."""

    @property
    def seconds(self) -> float:
        """How long any camera saw them."""
        spans = merge_pulse_ranges(span for ranges in self.visible.values() for span in ranges)
        return sum(span.end - span.first for span in spans) / self.session.info.fps


@dataclass(frozen=True, slots=True)
class RecordedTraces:
    """A person's traces in the recording."""

    numbers: frozenset[int]
    """All numbers of the person: merged ones are one person."""
    sessions: list[SessionTraces]
    """Those that mention the person, or have a playlist of them."""


def find_traces(sessions: Sequence[RecordingSession], numbers: Collection[int]) -> RecordedTraces:
    """Find a person's traces in sessions that share person numbers; blocks on the disk.

    Raises:
        OSError: a file cannot be read, or a session's folder is not in its place.
    """
    everyone = frozenset(_with_merged(sessions, numbers))
    found = [_traces(session, everyone) for session in sessions]
    for session in sessions:
        check_in_place(session)  # else nothing was found
    return RecordedTraces(
        everyone,
        [traces for traces in found if traces.gops or not everyone.isdisjoint(traces.session.objects.copy())],
    )


def _with_merged(sessions: Sequence[RecordingSession], numbers: Collection[int]) -> set[int]:
    """Return all numbers that were merged with these, directly or not."""
    merges = [
        {merge.kept, merge.lost}
        for session in sessions
        for path in all_decision_files(session)
        for choices in decisions_with(path, _HAS_MERGE)
        for merge in choices.merged
    ]
    found, before = set(numbers), -1
    while before != len(found):
        before = len(found)
        for merge in merges:
            if found & merge:
                found |= merge
    return found


def _traces(session: RecordingSession, numbers: Collection[int]) -> SessionTraces:
    traces, pattern, fps = SessionTraces(session), mention_pattern(numbers), session.info.fps
    margin, gap = round(MARGIN_S * fps), round(_GAP_S * fps)
    seen: dict[str, list[PulseRange]] = {}
    for path in all_decision_files(session):
        for choices in decisions_with(path, pattern):
            traces.gops += is_about(choices, numbers)
            for camera, frames in choices.boxes.items():
                pulses = [
                    choices.first + at
                    for at, boxes in enumerate(frames)
                    if any(box[0] in numbers for box in boxes)
                ]
                if pulses and camera in session.cameras:
                    seen.setdefault(camera, []).append(PulseRange(pulses[0], pulses[-1] + 1))
    traces.visible = {
        camera: [
            PulseRange(max(0, span.first - margin), span.end - gap + margin)
            for span in merge_pulse_ranges(PulseRange(each.first, each.end + gap) for each in spans)
        ]
        for camera, spans in seen.items()
    }
    _find_losses(traces, numbers)
    return traces


def _find_losses(traces: SessionTraces, numbers: Collection[int]) -> None:
    session = traces.session
    sound = session.audio.index
    found: set[tuple[str, int]] = set()
    for camera, ranges in traces.visible.items():
        for span in ranges:
            entries = session.cameras[camera].index.between(span.first, span.end)
            found.update((camera, entry.file) for entry in entries)
            found.update((AUDIO, entry.file) for entry in sound.between(span.first, span.end))
    traces.files = frozenset(SegmentFile(*file) for file in found)
    traces.lost = {camera: _frames_in(session.cameras[camera], found) for camera in traces.visible}
    traces.lost[AUDIO] = _frames_in(session.audio, found)
    for number, playlist in session.objects.copy().items():  # the writer adds people
        if number not in numbers and (frames := _frames_in(playlist, found)):
            traces.lost_by_others[number] = frames


def _frames_in(playlist: RecordingPlaylist, files: Collection[tuple[str, int]]) -> int:
    return sum(entry.frames for entry in playlist.index.all if (entry.camera, entry.file) in files)


def all_decision_files(session: RecordingSession) -> Iterable[Path]:
    """Yield the decision files of a session, in order; any thread may call it."""
    return (session.paths.decision_file(segment.first) for segment in tuple(session.segments))
