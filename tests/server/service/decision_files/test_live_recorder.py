"""A running site whose files cannot be written for a while: it goes on, and says of which frames."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from fakes.service.decisions import behind, choice, decision, noted
from fakes.service.scripted_cameras import CAMERAS, GOP, HEIGHT, SMALL, WIDTH
from fakes.system.full_disk import files_of_at_most
from server.media.letterbox import Letterbox
from server.service.decision_files.live_decision_writer import LiveDecisionWriter

A, B = CAMERAS
FITS = dict.fromkeys(CAMERAS, Letterbox((WIDTH, HEIGHT), (WIDTH, HEIGHT)))


def written(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.rglob("*.*")}


def test_what_could_not_be_written_is_said_once_there_is_room(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    recorder = LiveDecisionWriter(tmp_path, CAMERAS, FITS)
    recorder.write(decision(0, choice(1, A), c0=[[(1, *SMALL)]] * GOP))
    before = written(tmp_path)
    with files_of_at_most(max(map(len, before.values()))):
        for gop in (1, 2, 3):
            recorder.late(B, [gop * GOP], "tracks late")
            recorder.late(B, [4 * GOP], "no picture")
            recorder.write(decision(gop, choice(1, A), c0=[[(1, *SMALL)]] * GOP))
            assert written(tmp_path) == before
    recorder.write(decision(4, choice(1, B), c0=[[(1, *SMALL)]] * GOP))
    recorder.late(A, [5 * GOP], "tracks late")
    recorder.close()
    after = written(tmp_path)
    frames = [*range(1, GOP + 1), *range(4 * GOP + 1, 5 * GOP + 1)]
    assert [int(it.split(",")[0]) for it in after["choices.csv"].splitlines()[1:]] == frames
    assert [int(it.split(",")[0]) for it in after["c0.txt"].splitlines()] == frames
    assert after["late.csv"].splitlines()[1:] == [
        *[f"{4 * GOP + 1},{B},no picture"] * 3,
        f"{GOP + 1},,not written up to {4 * GOP}",
        f"{5 * GOP + 1},{A},tracks late",
    ]
    said = [it.getMessage() for it in caplog.records]
    assert len(said) == 2
    assert "decisions are skipped until writing succeeds" in said[0]
    assert f"{3 * GOP} frames are missing" in said[1]


def test_a_disk_that_is_full_at_the_end_is_said_and_all_files_are_whole(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    recorder = LiveDecisionWriter(tmp_path, CAMERAS, FITS)
    recorder.write(decision(0, choice(1, A)))
    before = written(tmp_path)
    recorder.late(B, [7], "tracks late")
    with files_of_at_most(0):
        recorder.close()
    assert written(tmp_path) == before
    assert "the end of late.csv could not be written" in caplog.text


async def test_a_service_decides_and_closes_whatever_its_disk_does(tmp_path: Path) -> None:
    service = behind()
    decided = noted(service)
    service._decision_writer = service.loss_recorder.decision_writer = service._open_decision_files(tmp_path)
    with files_of_at_most(0):
        service.decide()
        service.close()
    healthy = behind()
    expected = noted(healthy)
    healthy.decide()
    healthy.close()
    assert decided == expected
    assert decided
    assert (tmp_path / "choices.csv").read_text() == "frame,object,camera\n"
