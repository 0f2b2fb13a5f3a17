"""A full disk: no empty or incomplete files are left; live recordings keep earlier pictures."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

import client
from fakes.cli.command_line import RunCommand, myview
from fakes.media.videos import write_video
from fakes.service.fed_site import ServedSite, serve_site
from fakes.service.scripted_cameras import CAMERAS, LARGE, SMALL
from fakes.service.scripted_recordings import A, B, pictures
from fakes.system.full_disk import files_of_at_most
from server.cli.watch import run_watch
from server.system.errors import UserError

__all__ = ["myview"]

FRAMES = 30


@pytest.fixture
async def served() -> AsyncIterator[ServedSite]:
    async for site_served in serve_site():
        site_served.service.connect_cameras(*CAMERAS)
        for epoch in range(7):
            site_served.service.feed(epoch, {A: {1: LARGE, 2: SMALL}, B: {1: SMALL}})
        yield site_served


async def recorded(served: ServedSite, out: Path) -> None:
    await run_watch([f"http://127.0.0.1:{served.port}"], 1, out, None, "p0", f"p{FRAMES}")


async def stream_size(served: ServedSite, folder: Path) -> int:
    """Record the stream on a disk with enough space; return its bytes."""
    whole = await client.watch(
        f"http://127.0.0.1:{served.port}", 1, folder / "w.mp4", start="p0", end=f"p{FRAMES}"
    )
    return whole.bytes


@pytest.mark.parametrize("most", [0, 1, 500])
async def test_a_disk_without_room_for_a_picture_is_left_unchanged(
    served: ServedSite, tmp_path: Path, most: int
) -> None:
    out = tmp_path / "one.mp4"
    with (
        files_of_at_most(most),
        pytest.raises(UserError, match=r"one.mp4: cannot write there: File too large$"),
    ):
        await recorded(served, out)
    assert not list(tmp_path.iterdir())


async def test_an_older_recording_is_kept_if_there_is_no_room_for_a_new_one(
    served: ServedSite, tmp_path: Path
) -> None:
    out = tmp_path / "one.mp4"
    out.write_bytes(b"older")
    with files_of_at_most(100), pytest.raises(UserError, match=r"File too large$"):
        await recorded(served, out)
    assert out.read_bytes() == b"older"
    assert [path.name for path in tmp_path.iterdir()] == ["one.mp4"]


@pytest.mark.parametrize("part", [0.3, 0.6, 0.95])
async def test_a_disk_that_fills_up_keeps_only_complete_pictures(
    served: ServedSite, tmp_path: Path, part: float
) -> None:
    (tmp_path / "ample").mkdir()
    size, out = await stream_size(served, tmp_path / "ample"), tmp_path / "small" / "one.mp4"
    out.parent.mkdir()
    with (
        files_of_at_most(round(part * size)),
        pytest.raises(UserError, match=r"File too large; the recording up to then is kept$"),
    ):
        await recorded(served, out)
    assert all(path.stat().st_size for path in out.parent.iterdir()), "none is empty"
    assert "one.mp4" in {path.name for path in out.parent.iterdir()} <= {"one.mp4", "one.vtt", "one.ass"}
    shown = [place for place, _ in pictures(out)]
    assert 0 < len(shown) < FRAMES
    assert shown == list(range(shown[0], shown[0] + len(shown))), "each is complete"


async def test_a_recording_without_room_for_sidecar_files_is_kept_without_them(
    served: ServedSite, tmp_path: Path
) -> None:
    out = tmp_path / "one.mp4"
    (tmp_path / "one.ass").mkdir()  # nothing can be written
    with pytest.raises(UserError, match=r"kept$"):
        await recorded(served, out)
    (tmp_path / "one.ass").rmdir()
    assert [path.name for path in tmp_path.iterdir()] == ["one.mp4"]
    assert [place for place, _ in pictures(out)] == list(range(FRAMES))


@pytest.mark.parametrize("most", [0, 1000])
@pytest.mark.parametrize(
    "command",
    [
        "scene room --cameras 1 --objects 1 --seconds 0.4 --size 64x48",
        "render {video}",
        "track --det {det}",
        "calibrate {points}",
    ],
)
def test_a_command_without_disk_space_reports_it_in_one_line_and_leaves_nothing(
    tmp_path: Path, myview: RunCommand, command: str, most: int
) -> None:
    (tmp_path / "given").mkdir()
    video = write_video(tmp_path / "given" / "c0.mp4", 12)
    det = tmp_path / "given" / "det.txt"
    det.write_text("".join(f"{n},-1,10,5,20,30,1\n" for n in range(1, 200)), encoding="ascii")
    points = tmp_path / "given" / "points.csv"
    pairs = "c0,212,300,0,0\nc0,430,296,2.5,0\nc0,390,200,2.5,4\nc0,250,202,0,4\n"
    points.write_text(f"camera,image_x,image_y,floor_x,floor_y\n{pairs}", encoding="ascii")
    arguments = command.format(video=video, det=det, points=points).split()
    with files_of_at_most(most):
        result = myview(*arguments, "--out", tmp_path / "out")
    assert result.code == 2
    assert [line.rpartition(": ")[2] for line in result.err.splitlines()] == ["File too large"]
    assert [path.name for path in tmp_path.iterdir()] == ["given"]
