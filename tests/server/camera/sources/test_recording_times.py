"""Frame n at the site's rate is what a recording shows n / fps seconds after its first frame."""

from __future__ import annotations

import re
import subprocess
from contextlib import suppress
from itertools import accumulate
from pathlib import Path

import av
import numpy as np
import pytest
from av.video.stream import VideoStream
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.cli.command_line import RunCommand, myview
from fakes.media.videos import STEP, damage, frame_in, write_timed, write_video
from fakes.paths import DOCS
from fakes.programs import needs_ffmpeg
from server.camera.passthrough.compatibility import IncompatibleStreamError, RequiredFormat
from server.camera.passthrough.recording_source import PassthroughRecording
from server.camera.sources import SourceEndedError
from server.camera.sources.recording import Recording
from server.media.h264.codec import H264
from tracking.motchallenge import MotRow, read_rows, write_rows

__all__ = ["myview"]


def shown(path: Path, fps: float | None = None) -> list[int]:
    """Return which picture of a recording each pulse shows."""
    recording, frames = Recording(str(path), 0, "stop", fps), list[int]()
    with suppress(SourceEndedError):
        while (image := recording.take(len(frames))) is not None:
            frames.append(frame_in(image))
    recording.close()
    return frames


@pytest.mark.parametrize("suffix", ["mp4", "mkv", "ts"])
@pytest.mark.parametrize(("own", "fps"), [(30, 25), (25, 30), (25, 12.5), (12, 25), (25, 25)])
def test_a_view_of_another_rate_shows_the_same_moment_in_the_same_frame(
    tmp_path: Path, suffix: str, own: int, fps: float
) -> None:
    path = write_video(tmp_path / f"view.{suffix}", 25, fps=own)
    frames = shown(path, fps)
    assert abs(len(frames) - 25 / own * fps) < 1, "of equal duration"
    for pulse, frame in enumerate(frames):
        assert abs(frame / own - pulse / fps) <= max(0.5 / fps, 1 / own) + 1e-9
    if own % fps == 0:
        assert frames == list(range(0, 25, own // int(fps)))


@settings(deadline=None, max_examples=10)
@given(gaps=st.lists(st.integers(1, 12), min_size=2, max_size=24), fps=st.sampled_from([10.0, 25.0, 30.0]))
def test_pictures_at_uneven_times_are_shown_at_their_times(
    tmp_path_factory: pytest.TempPathFactory, gaps: list[int], fps: float
) -> None:
    times = [ticks / 50 for ticks in accumulate(gaps, initial=0)]
    path = write_timed(tmp_path_factory.mktemp("uneven") / "phone.mp4", times)
    frames = shown(path, fps)
    for pulse, frame in enumerate(frames):
        due = pulse / fps
        assert times[frame] <= due + 0.5 / fps, "none is shown more than half a frame early"
        assert not [time for time in times[frame + 1 :] if time <= due], "no later one is due"
    assert len(frames) >= times[-1] * fps


def test_a_recording_begins_with_its_first_frame_at_any_time_stamp(tmp_path: Path) -> None:
    late = write_timed(tmp_path / "late.ts", [3.2 + n / 25 for n in range(10)])
    assert shown(late, 25) == list(range(10))


def test_joined_files_continue_across_restarting_time_stamps(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    parts = [
        write_timed(
            tmp_path / f"{first}.ts",
            [begin + n / 25 for n in range(10)],
            pictures=[np.full((48, 64, 3), STEP * (first + n), np.uint8) for n in range(10)],
        )
        for first, begin in ((0, 100.0), (10, 0.0))
    ]
    joined = tmp_path / "joined.ts"
    joined.write_bytes(b"".join(part.read_bytes() for part in parts))
    frames = shown(joined, 25)
    assert [frames[:10], frames[-9:]] == [list(range(10)), list(range(11, 20))]
    assert len(frames) == 20
    assert [line for line in caplog.messages if "its time stamps jump" in line]


@pytest.mark.parametrize("b_frames", [0, 2])
@pytest.mark.parametrize("suffix", ["h264", "avi"])
def test_pictures_without_timestamps_are_numbered_even_if_some_are_undecodable(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, suffix: str, b_frames: int
) -> None:
    path = write_video(tmp_path / f"raw.{suffix}", 25, b_frames=b_frames)
    assert shown(path) == list(range(25))
    if suffix == "h264":
        assert caplog.messages == [f"{path}: no time stamps in this file: frames are counted at 25 a second"]
    if suffix == "avi":
        frames = shown(damage(path, [10]))
        assert len(frames) == 25
        assert [frames[n] for n in (2, 5, 22, 23)] == [2, 5, 22, 23]


def write_without_frames(path: Path, frames: range, into: Path) -> Path:
    """Write an MPEG transport stream without the packets of some frames, as a bad network loses them."""
    with av.open(str(path)) as container:
        places = [packet.pos or 0 for packet in container.demux(video=0) if packet.size]
    data = path.read_bytes()
    into.write_bytes(data[: places[frames.start]] + data[places[frames.stop] :])
    return into


def test_missing_frames_do_not_shift_later_ones_and_are_logged(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    whole = write_video(tmp_path / "whole.ts", 25)
    frames = shown(write_without_frames(whole, range(10, 12), tmp_path / "lossy.ts"))
    assert len(frames) == 25
    assert frames[:10] == list(range(10))
    assert frames[20:] == list(range(20, 25)), "the next keyframe is in place"
    assert any(
        re.search(r"lossy.ts: \d+ (damaged frames|frames are missing)", message)
        for message in caplog.messages
    )


@pytest.mark.parametrize("suffix", ["mp4", "avi"])
def test_damaged_frames_are_counted_and_named_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, suffix: str
) -> None:
    path = damage(write_video(tmp_path / f"hurt.{suffix}", 25, codec="mjpeg"), [3, 4, 9])
    recording = Recording(str(path), 0, "loop")
    frames = [frame_in(image) for n in range(75) if (image := recording.take(n)) is not None]
    recording.close()
    expected = [2 if n in (3, 4) else 8 if n == 9 else n for n in range(25)]
    assert frames == 3 * expected
    assert caplog.messages == [
        f"{path}: 3 damaged frames are replaced by the previous one: frames 4 to 5, 10"
    ]


def test_a_different_frame_rate_is_logged_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = write_video(tmp_path / "view.mp4", 10, fps=30)
    recording = Recording(str(path), 0, "stop", 25.0)
    list(recording.prescan_images(range(5)))
    recording.close()
    assert caplog.messages == [
        f"{path} has 30 frames a second, the site 25: frames keep their times, some are dropped"
    ]


@needs_ffmpeg
@pytest.mark.parametrize("suffix", ["mp4", "mkv"])
def test_the_documented_command_corrects_a_wrong_rate_without_encoding_again(
    tmp_path: Path, suffix: str
) -> None:
    write_video(tmp_path / f"in.{suffix}", 25, fps=30)
    text = (DOCS / "reference" / "cli.md").read_text(encoding="utf-8")
    (command,) = re.findall(r"`(ffmpeg -itsscale [^`]*)`", text)
    words = command.replace("in.mp4", f"in.{suffix}").split()
    subprocess.run(words, cwd=tmp_path, check=True, capture_output=True, timeout=60)
    out = tmp_path / "out.mp4"
    assert shown(out) == shown(out, 7.0) == list(range(25))
    recording = Recording(str(out), quiet=True)
    assert recording.fps == pytest.approx(7.0, rel=1e-3)
    recording.close()


def test_an_uneven_frame_rate_is_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = write_timed(tmp_path / "phone.mp4", [0, 0.04, 0.2, 0.24, 0.4, 0.44, 0.6, 0.64])
    shown(path)
    (line,) = caplog.messages
    assert "its frame rate is uneven" in line


def test_video_without_one_frame_per_pulse_is_not_passed_through(tmp_path: Path) -> None:
    def of_the_site(stream: VideoStream) -> None:
        stream.options = {**stream.options, "g": "10", "sc_threshold": "0"}

    times = [n / 25 for n in range(41) if n != 35]
    hole = write_timed(tmp_path / "hole.mp4", times, prepare=of_the_site)
    with pytest.raises(
        IncompatibleStreamError, match=r"frame 35 is shown at 1.44 s, which is frame 36 at the site's 25 "
    ):
        PassthroughRecording(str(hole), 0, "stop", RequiredFormat((64, 48), 25.0, 10, H264, None))


def test_views_of_two_frame_rates_are_rendered_to_one_length(tmp_path: Path, myview: RunCommand) -> None:
    write_video(tmp_path / "a.mp4", 25, fps=25)
    write_timed(tmp_path / "b.mp4", [n / 30 for n in range(30)], fps=30)
    result = myview("render", tmp_path / "a.mp4", tmp_path / "b.mp4", "--out", tmp_path / "out")
    assert result.code == 0
    assert "the views are of different length" not in result.err


def test_detections_belong_to_the_pictures_they_were_made_from(tmp_path: Path, myview: RunCommand) -> None:
    """A detector counts pictures; tracks count frames of the site's clock."""
    times = [(n + 2 * (n // 10)) / 25 for n in range(40)]  # every now and then two are not taken
    video = write_timed(tmp_path / "phone.mp4", times)
    made_of = [MotRow(n + 1, -1, 10.0 + n, 5.0, 12.0, 30.0, 1.0) for n in range(len(times))]
    write_rows(tmp_path / "det.txt", made_of)
    (tmp_path / "site.yaml").write_text("site: {fps: 25, width: 64, height: 48}")
    result = myview(
        *("track", video, "--det", tmp_path / "det.txt", "--config", tmp_path / "site.yaml"),
        *("--out", tmp_path / "tracks.txt"),
    )
    assert result.code == 0, result.err
    found = {row.frame - 1: row.left for row in read_rows(tmp_path / "tracks.txt")}
    assert [found[round(time * 25)] for time in times] == [10.0 + n for n in range(len(times))]
