"""Long recordings: memory does not grow with their length."""

from __future__ import annotations

import json
import tracemalloc
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest

import client
from client.model import Box, Gop, Site
from client.sidecar import sidecars, write_sidecars
from client.spool import Spool
from client.stream_events import Frame, ViewHistory
from fakes.service.fed_site import ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, GOP, LARGE, SMALL
from fakes.service.scripted_recordings import A, B

SITE = Site("hall", 25.0, 320, 240, GOP, 25, None, None, 0.0, ("c0",))
BOX = Box(1, 40.04, 60.0, 80.0, 160.0)
VTT = """WEBVTT

NOTE the best view of object 1 of hall; boxes: object, left, top, right, bottom \
in pixels of a picture of 320x240

p7
00:00:00.080 --> 00:00:00.120
{"camera":"c0","boxes":[[1,40.0,60.0,80.0,160.0],[2,1.3,2.0,3.0,4.0]]}

p8
00:00:00.120 --> 00:00:00.160
{"camera":"c1","boxes":[]}
"""
DRAWN = """Dialogue: 0,00:00:00.08,00:00:00.12,Shown,,0,0,0,,{\\pos(0,0)\\p1}m 40 60 l 80 60 80 160 40 160
Dialogue: 1,00:00:00.08,00:00:00.12,Name,,0,0,0,,{\\pos(40,58)}1
Dialogue: 0,00:00:00.08,00:00:00.12,Other,,0,0,0,,{\\pos(0,0)\\p1}m 1 2 l 3 2 3 4 1 4
Dialogue: 1,00:00:00.08,00:00:00.12,Name,,0,0,0,,{\\pos(1,0)}2
"""


def written_texts(film: Path, frames: list[Frame]) -> tuple[str, str]:
    write_sidecars(film, iter(frames), 5, 1, SITE)
    vtt, ass = (path.read_bytes().decode() for path in sidecars(film))
    return vtt, ass.partition("Effect, Text\n")[2]


def test_the_sidecar_files_have_these_bytes(tmp_path: Path) -> None:
    frames = [Frame(7, "c0", (BOX, Box(2, 1.26, 2.0, 3.0, 4.0))), Frame(8, "c1", ())]
    assert written_texts(tmp_path / "one.mp4", frames) == (VTT, DRAWN)
    head = "\n".join(VTT.split("\n")[:3]) + "\n"
    assert written_texts(tmp_path / "none.mp4", []) == (head, "\n")


def peak_memory(film: Path, frames: int) -> int:
    """Return the bytes that writing takes at most."""
    all_frames: Iterator[Frame] = (Frame(pulse, "c0", (BOX,) * 5) for pulse in range(frames))
    tracemalloc.start()
    try:
        write_sidecars(film, all_frames, 0, 1, SITE)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_does_not_grow_with_the_number_of_frames(tmp_path: Path) -> None:
    film = tmp_path / "one.mp4"
    peak_memory(film, 10)  # allocated only once
    few, many = peak_memory(film, 100), peak_memory(film, 1000)
    assert film.with_suffix(".ass").stat().st_size > 500_000
    assert many < few + 50_000


def gop_event(gop: int) -> Gop:
    boxes = tuple((BOX,) * 5 for _ in range(GOP))
    return Gop(first=gop * GOP, frames=GOP, choices={1: "c0"}, boxes={"c0": boxes}, cuts=())


def memory_in_use(folder: Path, gops: int) -> int:
    """Return the bytes of memory in use after some events."""
    spool = Spool(folder)
    history = ViewHistory(1, spool=spool)
    history.take(gop_event(0))
    tracemalloc.start()
    try:
        for gop in range(gops):
            history.take(gop_event(gop))
        kept = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    assert sum(1 for _ in history.stored_frames(0, gops * GOP)) == gops * GOP
    spool.close()
    return kept


def test_boxes_are_spooled_to_disk(tmp_path: Path) -> None:
    packed = GOP * 5 * 30  # bytes of a GOP's boxes, at least
    assert memory_in_use(tmp_path, 500) < 500 * packed / 2
    assert not list(tmp_path.iterdir()), "the file is unnamed, so it ends with the process"


def test_repeated_events_replace_earlier_ones_and_late_ones_are_sorted(tmp_path: Path) -> None:
    spool = Spool(tmp_path)
    history = ViewHistory(1, spool=spool)
    for gop in (2, 0, 1):
        history.take(gop_event(gop))
    repeated = tuple((BOX,) for _ in range(GOP))
    history.take(Gop(first=GOP, frames=GOP, choices={1: "c1"}, boxes={"c1": repeated}, cuts=()))
    frames = list(history.stored_frames(0, 3 * GOP))
    assert [frame.pulse for frame in frames] == list(range(3 * GOP))
    assert [len(frame.boxes) for frame in frames] == [5] * GOP + [1] * GOP + [5] * GOP
    assert frames[GOP].camera == "c1"
    spool.close()


def test_without_disk_space_choices_are_kept_without_boxes(tmp_path: Path) -> None:
    history = ViewHistory(1, spool=Spool(tmp_path / "none"))
    history.take(SITE)
    history.take(gop_event(0))
    assert history.camera_at(0.1) == "c0"
    assert list(history.stored_frames(0, GOP)) == []


@pytest.fixture
async def served() -> AsyncIterator[ServedSite]:
    """Person 1 in both cameras."""
    async for site_served in serve_site():
        site_served.service.connect_cameras(*CAMERAS)
        for epoch in range(7):
            site_served.service.feed(epoch, {A: {1: LARGE}, B: {1: SMALL}})
        yield site_served


async def test_the_recording_is_finished_before_the_sidecar_files(
    served: ServedSite, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "one.mp4"
    names: list[list[str]] = []

    def killed(*_: object) -> None:
        names.append(sorted(path.name for path in tmp_path.iterdir()))
        raise MemoryError

    monkeypatch.setattr("client.player.write_sidecars", killed)
    with pytest.raises(MemoryError):
        await client.watch(f"http://127.0.0.1:{served.port}", 1, out, start="p0", end="p25")
    assert names == [["one.mp4"]]


async def test_a_recording_has_sidecar_files_with_boxes(served: ServedSite, tmp_path: Path) -> None:
    out = tmp_path / "one.mp4"
    await client.watch(f"http://127.0.0.1:{served.port}", 1, out, start="p0", end="p25")
    cues = out.with_suffix(".vtt").read_text().strip().split("\n\n")[2:]
    assert [json.loads(cue.split("\n")[2])["boxes"] for cue in cues] == [[[1, *LARGE]]] * 25
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.ass", "one.mp4", "one.vtt"]
