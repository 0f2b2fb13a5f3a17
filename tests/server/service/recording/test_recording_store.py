"""Recordings play from the disk, are deleted in order of age, and stay within their limits."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fakes.media.decoding import decodes_without_errors
from fakes.service.scripted_cameras import FPS, GOP
from fakes.service.scripted_recordings import (
    PULSE0,
    UNLIMITED,
    A,
    B,
    ManualClocks,
    filled_buffers,
    gop_record,
    own_pictures,
    pictures,
    playable_files,
    session_info,
    written_folder,
)
from fakes.system.full_disk import files_of_at_most
from server.service.recording.media_files import MediaFile, read_gops
from server.service.recording.recording_folder import RecordingFolder
from server.service.recording.retention import RetentionLimits
from server.service.recording.session_files import InitSegments


def only_run(folder: Path) -> Path:
    (session,) = (path for path in folder.iterdir() if path.is_dir())
    return session


def test_a_persons_playlist_plays_the_chosen_cameras_pixels_across_cuts(
    tmp_path: Path,
) -> None:
    choices = [A, A, B, B, A, B, A, A, A, B, B, A]
    store = written_folder(
        RecordingFolder(tmp_path, UNLIMITED),
        [gop_record(gop, {1: camera}) for gop, camera in enumerate(choices)],
    )
    during = list(pictures(only_run(tmp_path) / "objects" / "1.m3u8"))
    store.close()
    after = list(pictures(only_run(tmp_path) / "objects" / "1.m3u8"))
    for played in (during, after):
        assert [pulse for pulse, _ in played] == list(range(len(choices) * GOP))
        for pulse, picture in played:
            np.testing.assert_array_equal(picture, own_pictures(choices[pulse // GOP])[pulse])


def test_a_camera_is_written_once_however_many_people_it_shows(tmp_path: Path) -> None:
    few = written_folder(
        RecordingFolder(tmp_path / "few", UNLIMITED), [gop_record(gop, {1: A}) for gop in range(4)]
    )
    many = written_folder(
        RecordingFolder(tmp_path / "many", UNLIMITED),
        [gop_record(gop, dict.fromkeys(range(50), A)) for gop in range(4)],
    )
    few.close()
    many.close()
    sizes = [sum(path.stat().st_size for path in folder.rglob("*.mp4")) for folder in tmp_path.iterdir()]
    assert sizes[0] == sizes[1]


def test_every_file_and_playlist_decodes_without_errors_even_with_gaps(tmp_path: Path) -> None:
    pieces = [gop_record(gop, {1: A, 2: B} if gop % 4 else {1: A}) for gop in range(12) if gop != 7]
    written_folder(RecordingFolder(tmp_path, UNLIMITED), pieces).close()
    files = playable_files(tmp_path)
    assert len(files) == 2 + 2 + 3 * 2, "two people, two cameras, three files each"
    for path in files:
        decodes_without_errors(path)


def test_a_playlist_conforms_to_rfc_8216(tmp_path: Path) -> None:
    written_folder(
        RecordingFolder(tmp_path, UNLIMITED),
        [gop_record(gop, {1: B if gop == 3 else A}) for gop in range(7) if gop != 5],
    )
    text = (only_run(tmp_path) / "objects" / "1.m3u8").read_text()
    lines = text.splitlines()
    assert lines[0] == "#EXTM3U"
    assert lines[-1] == "#EXT-X-ENDLIST"
    assert text.count("#EXT-X-ENDLIST") == 1
    target = next(int(line.partition(":")[2]) for line in lines if line.startswith("#EXT-X-TARGETDURATION"))
    assert all(
        round(float(line[8:].split(",")[0])) <= target for line in lines if line.startswith("#EXTINF:")
    )
    assert lines.count("#EXT-X-DISCONTINUITY") == 1, "where GOP 5 is missing"
    assert "#EXT-X-PROGRAM-DATE-TIME:2025-11-21T04:40:00.000Z" in lines
    for place, line in enumerate(lines):
        if line.startswith("#EXT-X-BYTERANGE:"):
            length, offset = map(int, line.partition(":")[2].split("@"))
            data = (only_run(tmp_path) / "objects" / lines[place + 1]).read_bytes()[offset : offset + length]
            assert data[4:8] == b"moof"
            assert len(data) == length


def test_the_decision_file_has_choices_and_boxes(tmp_path: Path) -> None:
    written_folder(
        RecordingFolder(tmp_path, UNLIMITED), [gop_record(gop, {1: A}) for gop in range(7)]
    ).close()
    first, second = sorted((only_run(tmp_path) / "index").iterdir())
    lines = [json.loads(line) for path in (first, second) for line in path.read_text().splitlines()]
    assert [line["first"] for line in lines] == [gop * GOP for gop in range(7)]
    assert lines[0]["choices"] == {"1": A}
    assert lines[0]["boxes"][B][0] == [[1, 1.0, 2.0, 3.0, 4.0]]


def test_an_incomplete_gop_is_in_the_cameras_playlist_but_in_no_persons(tmp_path: Path) -> None:
    pieces = [gop_record(0, {1: A}), gop_record(1, {1: A}, frames=3), gop_record(2, {1: A})]
    session = written_folder(RecordingFolder(tmp_path, UNLIMITED), pieces).session
    assert session is not None
    assert [pulse for pulse, _ in pictures(session.cameras[A].path)] == [
        0,
        1,
        2,
        3,
        4,
        5,
        6,
        7,
        10,
        11,
        12,
        13,
        14,
    ]
    assert [(entry.first, entry.end) for entry in session.objects[1].index.all] == [(0, 5), (10, 15)]


def test_a_restarted_service_records_a_new_session_beside_the_earlier_one(tmp_path: Path) -> None:
    written_folder(
        RecordingFolder(tmp_path, UNLIMITED), [gop_record(gop, {1: A}) for gop in range(3)]
    ).close()
    second = written_folder(
        RecordingFolder(tmp_path, UNLIMITED), [gop_record(gop, {1: B}) for gop in range(3)]
    )
    assert len([path for path in tmp_path.iterdir() if path.is_dir()]) == 2
    (earlier,) = second.earlier
    assert [(entry.first, entry.end) for entry in earlier.objects[1].index.all] == [(0, 15)]
    for session, camera in ((earlier, A), (second.session, B)):
        assert session is not None
        for pulse, picture in pictures(session.objects[1].path):
            np.testing.assert_array_equal(picture, own_pictures(camera)[pulse])


def test_restarted_pulses_begin_a_new_session(tmp_path: Path) -> None:
    store = written_folder(
        RecordingFolder(tmp_path, UNLIMITED), [gop_record(gop, {1: A}) for gop in (5, 6, 0, 1)]
    )
    assert store.session is not None
    assert [(entry.first, entry.end) for entry in store.session.objects[1].index.all] == [(0, 10)]
    assert [(entry.first, entry.end) for entry in store.earlier[0].objects[1].index.all] == [(25, 35)]


def test_two_processes_do_not_record_into_one_folder(tmp_path: Path) -> None:
    store = written_folder(RecordingFolder(tmp_path, UNLIMITED), [])
    with pytest.raises(BlockingIOError):
        RecordingFolder(tmp_path, UNLIMITED).open()
    store.close()
    RecordingFolder(tmp_path, UNLIMITED).open()


def test_old_segments_are_deleted_whole_with_their_references(tmp_path: Path) -> None:
    clocks = ManualClocks()
    store = RecordingFolder(tmp_path, RetentionLimits(keep_s=3.0, max_mb=1e6, segment_s=1.0), clocks.machine)
    store.open()
    for gop in range(40):
        clocks.now = PULSE0 + gop * GOP / FPS
        store.write(
            gop_record(gop, {1: A, 2 if gop < 10 else 3: B}),
            session_info(),
            InitSegments(filled_buffers()[1]),
        )
    store.close()
    session = store.session
    assert session is not None
    assert [segment.first for segment in session.segments] == [100, 125, 150, 175]
    assert sorted(session.objects) == [1, 3]
    assert not (session.folder / "objects" / "2.m3u8").exists()
    kept = sorted(int(path.stem) for path in (session.folder / "cameras" / A).iterdir())
    assert (
        kept
        == [100, 125, 150, 175]
        == sorted(int(path.stem) for path in (session.folder / "index").iterdir())
    )
    assert [pulse for pulse, _ in pictures(session.objects[1].path)] == list(range(100, 200))


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.dictionaries(st.integers(1, 4), st.sampled_from([A, B])), min_size=1, max_size=40), st.data()
)
def test_the_size_stays_bounded_and_a_restart_reads_the_same_indexes(
    tmp_path_factory: pytest.TempPathFactory, shown: list[dict[int, str]], data: st.DataObject
) -> None:
    folder = tmp_path_factory.mktemp("bounded")
    max_mb = data.draw(st.sampled_from([0.05, 0.1, 1.0]))
    store = RecordingFolder(folder, RetentionLimits(keep_s=1e6, max_mb=max_mb, segment_s=0.4))
    store.open()
    slack = 2 * 8_000  # bytes: a GOP of both cameras, its line, its references
    for gop, choices in enumerate(shown):
        store.write(gop_record(gop, choices), session_info(), InitSegments(filled_buffers()[1]))
        on_disk = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
        assert on_disk <= max_mb * 1e6 + slack
    store.close()
    reopened = RecordingFolder(folder, UNLIMITED)
    reopened.open()
    assert store.session is not None
    found = {
        number: playlist.index.all
        for session in reopened.earlier
        for number, playlist in session.objects.items()
    }
    assert found == {number: playlist.index.all for number, playlist in store.session.objects.items()}
    for number, entries in found.items():
        expected = [gop for gop, choices in enumerate(shown) if number in choices]
        kept = [pulse // GOP for entry in entries for pulse in range(entry.first, entry.end, GOP)]
        assert kept == expected[len(expected) - len(kept) :], "the newest, without a new gap"
        for entry in entries:
            path = reopened.earlier[0].paths.camera_file(entry.camera, entry.file)
            assert [gop.first for gop in read_gops(path, entry.offset, entry.length, FPS)] == list(
                range(entry.first, entry.end, GOP)
            )
    reopened.close()


def test_on_a_full_disk_earlier_gops_play_and_recording_continues_later(tmp_path: Path) -> None:
    store = written_folder(
        RecordingFolder(tmp_path, UNLIMITED), [gop_record(gop, {1: A}) for gop in range(2)]
    )
    assert store.session is not None
    size = store.session.paths.camera_file(A, 0).stat().st_size
    with files_of_at_most(size + 300), pytest.raises(OSError, match="large") as refused:
        store.write(gop_record(2, {1: A}), session_info(), InitSegments(filled_buffers()[1]))
    assert refused.value.errno == errno.EFBIG
    store.abandon_segment()
    assert store.session.paths.camera_file(A, 0).stat().st_size == size
    with files_of_at_most(len(filled_buffers()[1]) + 300), pytest.raises(OSError, match="large"):
        store.write(gop_record(3, {1: A}), session_info(), InitSegments(filled_buffers()[1]))
    store.abandon_segment()
    store.write(gop_record(4, {1: A}), session_info(), InitSegments(filled_buffers()[1]))
    store.close()
    assert [pulse // GOP for pulse, _ in pictures(store.session.objects[1].path)][::GOP] == [0, 1, 4]
    for path in playable_files(tmp_path):
        decodes_without_errors(path)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.3, 0.9])
def test_a_writer_killed_in_the_middle_of_a_gop_leaves_a_file_that_plays(
    tmp_path: Path, share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    gop_of = gop_record(0, {}).cameras[A], gop_record(1, {}).cameras[A]
    path = tmp_path / "0.mp4"
    file = MediaFile(path, filled_buffers()[1])
    file.append(gop_of[0])

    class KilledError(BaseException):
        pass

    real = os.pwrite

    def killed(handle: int, data: bytes, offset: int) -> int:
        real(handle, bytes(data)[: max(8, round(len(data) * share))], offset)
        raise KilledError

    monkeypatch.setattr(os, "pwrite", killed)
    with pytest.raises(KilledError):
        file.append(gop_of[1])
    file.close()
    decodes_without_errors(path)
    assert [pulse for pulse, _ in pictures(path)] == list(range(GOP))
