"""A site whose decision files cannot be written for a while continues, and lists the missing frames."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from fakes.service.decisions import choice, collect_decisions, decision, service_with_backlog
from fakes.service.scripted_cameras import CAMERAS, GOP, HEIGHT, SMALL, WIDTH
from fakes.system.full_disk import files_of_at_most
from server.media.letterbox import Letterbox
from server.service.decision_files.live_decision_writer import LiveDecisionWriter, open_decision_files

A, B = CAMERAS
LETTERBOXES = dict.fromkeys(CAMERAS, Letterbox((WIDTH, HEIGHT), (WIDTH, HEIGHT)))


def read_files(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.rglob("*.*")}


def test_skipped_decisions_are_listed_once_there_is_room(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    writer = LiveDecisionWriter(tmp_path, CAMERAS, LETTERBOXES)
    writer.write_or_skip(decision(0, choice(1, A), c0=[[(1, *SMALL)]] * GOP))
    before = read_files(tmp_path)
    with files_of_at_most(max(map(len, before.values()))):
        for gop in (1, 2, 3):
            writer.add_late(B, [gop * GOP], "tracks late")
            writer.add_late(B, [4 * GOP], "no frame")
            writer.write_or_skip(decision(gop, choice(1, A), c0=[[(1, *SMALL)]] * GOP))
            assert read_files(tmp_path) == before
    writer.write_or_skip(decision(4, choice(1, B), c0=[[(1, *SMALL)]] * GOP))
    writer.add_late(A, [5 * GOP], "tracks late")
    writer.close()
    after = read_files(tmp_path)
    frames = [*range(1, GOP + 1), *range(4 * GOP + 1, 5 * GOP + 1)]
    assert [int(line.split(",")[0]) for line in after["choices.csv"].splitlines()[1:]] == frames
    assert [int(line.split(",")[0]) for line in after["c0.txt"].splitlines()] == frames
    assert after["late.csv"].splitlines()[1:] == [
        *[f"{4 * GOP + 1},{B},no frame"] * 3,
        f"{GOP + 1},,not written up to {4 * GOP}",
        f"{5 * GOP + 1},{A},tracks late",
    ]
    logged = [record.getMessage() for record in caplog.records]
    assert len(logged) == 2
    assert "decisions are skipped until writing succeeds" in logged[0]
    assert f"{3 * GOP} frames are missing" in logged[1]


def test_a_full_disk_at_the_end_is_logged_and_all_files_are_intact(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    writer = LiveDecisionWriter(tmp_path, CAMERAS, LETTERBOXES)
    writer.write_or_skip(decision(0, choice(1, A)))
    before = read_files(tmp_path)
    writer.add_late(B, [7], "tracks late")
    with files_of_at_most(0):
        writer.close()
    assert read_files(tmp_path) == before
    assert "the end of late.csv could not be written" in caplog.text


async def test_a_service_decides_and_closes_despite_a_full_disk(tmp_path: Path) -> None:
    service = service_with_backlog()
    decided = collect_decisions(service)
    service.decision_writer = service.loss_recorder.decision_writer = open_decision_files(
        tmp_path, CAMERAS, service.decider.people.letterboxes
    )
    with files_of_at_most(0):
        service.decide()
        service.close()
    healthy = service_with_backlog()
    expected = collect_decisions(healthy)
    healthy.decide()
    healthy.close()
    assert decided == expected
    assert decided
    assert (tmp_path / "choices.csv").read_text() == "frame,object,camera\n"
