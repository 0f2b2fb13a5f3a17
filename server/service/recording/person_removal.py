"""Removes a person from one recorded session: playlists, and files of video and sound."""

from __future__ import annotations

import contextlib
from collections.abc import Collection
from pathlib import Path

import msgspec

from server.service.recording.recording_session import RecordingSession
from server.service.recording.session_files import AUDIO, MISSING, CameraName


class SegmentFile(msgspec.Struct, frozen=True, array_like=True, order=True):
    """One file of a session: of a camera, or of the sound."""

    camera: CameraName
    """A camera, or `AUDIO`."""
    first: int
    """The first pulse of the segment."""


def remove_from_session(
    session: RecordingSession, numbers: Collection[int], files: Collection[SegmentFile]
) -> None:
    """Remove people's playlists, and files; others' playlists lose what was in these. In the writer thread.

    Repeating it is harmless.

    Raises:
        OSError: a file cannot be deleted, or the folder is not in its place.
    """
    check_in_place(session)
    gone = {(file.camera, file.first) for file in files}
    for playlist in session.playlists:
        playlist.drop_files(gone)
    removed = [session.folder / "objects" / f"{number}.m3u8" for number in numbers]
    session.objects = {
        number: playlist for number, playlist in session.objects.items() if number not in numbers
    }
    for path in (*removed, *(path_of(session, file) for file in files)):
        with contextlib.suppress(*MISSING):
            path.unlink()
    session.rewrite_stale_playlists()
    session.recount()


def path_of(session: RecordingSession, file: SegmentFile) -> Path:
    """Return where a file of a session is."""
    if file.camera == AUDIO:
        return session.paths.audio_file(file.first)
    return session.paths.camera_file(file.camera, file.first)


def check_in_place(session: RecordingSession) -> None:
    """Check that a session's folder is still the same one: files may be missing for no other reason.

    Raises:
        FileNotFoundError: it is not; the text says what to do.
    """
    if not session.is_in_place:
        raise FileNotFoundError(
            f"{session.folder}: not there any more: mount its disk, or restart without it"
        )
