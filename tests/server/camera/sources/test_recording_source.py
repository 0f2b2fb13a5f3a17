"""A recording shows its frame n - offset at pulse n, despite damage and missed pulses."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Literal

import av
import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.media.videos import HEIGHT, STEP, WIDTH, damage, frame_in, write_video
from server.camera.sources import SourceEndedError, open_source
from server.camera.sources.base import FrameSource
from server.camera.sources.image_folder import ImageFolder
from server.camera.sources.recording import Recording
from server.config.sections import CameraSettings, SiteSettings
from server.system.errors import UserError

FRAMES = 25


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(write_video(tmp_path_factory.mktemp("videos") / "greys.mp4", FRAMES, b_frames=2))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("images")
    for number in range(5):
        cv2.imwrite(str(path / f"{number:03}.png"), np.full((HEIGHT, WIDTH, 3), STEP * number, np.uint8))
    (path / "notes.txt").write_text("no image")
    return path


def shown(source: FrameSource, pulse: int) -> int | None:
    picture = source.take(pulse)
    return None if picture is None else frame_in(picture)


def all_shown(source: FrameSource) -> list[int | None]:
    frames: list[int | None] = []
    with suppress(SourceEndedError):
        while True:
            frames.append(shown(source, len(frames)))
    source.close()
    return frames


def test_every_frame_is_shown_once_and_in_order(video: str) -> None:
    assert all_shown(Recording(video, 0, "stop")) == list(range(FRAMES))


def test_an_offset_shows_nothing_before_and_then_the_first_frame(video: str) -> None:
    assert all_shown(Recording(video, 3, "stop")) == [None, None, None, *range(FRAMES)]
    assert all_shown(Recording(video, -20, "stop")) == list(range(20, FRAMES))


@settings(deadline=None, max_examples=40)
@given(
    steps=st.lists(st.integers(1, 40), min_size=1, max_size=12),
    offset=st.integers(-30, 30),
)
def test_a_looped_recording_returns_the_exact_frame_despite_missed_pulses(
    video: str, steps: list[int], offset: int
) -> None:
    recording = Recording(video, offset, "loop")
    for pulse in np.cumsum(steps).tolist():
        index = pulse - offset
        assert shown(recording, pulse) == (None if index < 0 else index % FRAMES)
    recording.close()


@pytest.mark.parametrize("at_end", ["stop", "loop"])
@pytest.mark.parametrize("offset", [0, 3, -20])
def test_looking_ahead_does_not_move_the_recording(
    video: str, offset: int, at_end: Literal["stop", "loop"]
) -> None:
    source = Recording(video, offset, at_end)
    assert [frame_in(picture) for picture in source.prescan_images(range(0, 500, 7))] == [0, 7, 14, 21]
    first = max(offset, 0)
    assert shown(source, first) == first - offset
    source.close()


def test_ahead_skips_unreadable_images(folder: Path, tmp_path: Path) -> None:
    for file in folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / "002.png").write_text("no image")
    source = ImageFolder(str(tmp_path), 2, "loop")
    assert [frame_in(picture) for picture in source.prescan_images(range(0, 500, 2))] == [0, 4]
    assert shown(source, 2) == 0


def test_a_pulse_beyond_the_end_ends_the_source(video: str) -> None:
    recording = Recording(video, 0, "stop")
    for _ in range(2):
        with pytest.raises(SourceEndedError):
            recording.take(1000)
    recording.close()


@pytest.mark.parametrize("b_frames", [0, 2])
@pytest.mark.parametrize("packets", [[3], [10], [0], [0, 1, 2], [7, 8, 9, 20], [FRAMES - 1]])
def test_damage_shifts_no_other_frame(tmp_path: Path, packets: list[int], b_frames: int) -> None:
    path = write_video(tmp_path / "damaged.mp4", FRAMES, b_frames=b_frames)
    frames = all_shown(Recording(str(damage(path, packets)), 0, "stop"))
    assert len(frames) == FRAMES
    broken = {packet // 10 for packet in packets}  # a GOP with damage may show anything
    whole = [number for number in range(FRAMES) if number // 10 not in broken]
    # Pictures next to a damaged GOP may be affected.
    unaffected = [number for number in whole if 1 < number % 10 < 9]
    assert [frames[number] for number in unaffected] == unaffected


def test_a_damaged_picture_is_replaced_by_the_one_before_it(tmp_path: Path) -> None:
    path = damage(write_video(tmp_path / "damaged.avi", 8, codec="mjpeg"), [0, 4, 7])
    assert all_shown(Recording(str(path), 0, "stop")) == [1, 1, 2, 3, 3, 5, 6, 6]


def test_a_truncated_file_ends_early(tmp_path: Path) -> None:
    path = write_video(tmp_path / "cut.avi", FRAMES, codec="mjpeg")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    frames = all_shown(Recording(str(path), 0, "stop"))
    assert 0 < len(frames) < FRAMES
    assert frames[:-1] == list(range(len(frames) - 1)), "the last picture may be incomplete"


def refusal(source: str) -> str:
    with pytest.raises(UserError) as caught:
        open_source(CameraSettings(id="door", source=source), SiteSettings())
    text = str(caught.value)
    assert text.startswith("camera door: ")
    assert "\n" not in text
    return text


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    assert refusal(str(tmp_path / "none.mp4")).endswith("none.mp4: no such file or folder")


@pytest.mark.parametrize("content", [b"", b"\x00" * 5000, b"Dear diary,\n" * 50, bytes(range(256)) * 40])
def test_files_without_video_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "broken.mp4"
    path.write_bytes(content)
    assert "cannot open this video" in refusal(str(path))


def test_a_truncated_mp4_is_refused(tmp_path: Path) -> None:
    path = write_video(tmp_path / "half.mp4", FRAMES)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert "half.mp4: cannot" in refusal(str(path))


def test_a_video_without_decodable_pictures_is_refused(tmp_path: Path) -> None:
    path = damage(write_video(tmp_path / "noise.mp4", 5), [0, 1, 2, 3, 4])
    assert "has no frames" in refusal(str(path))


def test_sound_alone_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sound.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=44100)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
        frame.sample_rate = 44100
        container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    assert "there is no video in this file" in refusal(str(path))


def test_a_folder_is_a_recording_of_its_images(folder: Path) -> None:
    assert all_shown(ImageFolder(str(folder), 2, "stop")) == [None, None, 0, 1, 2, 3, 4]
    repeated = ImageFolder(str(folder), 0, "loop")
    assert [shown(repeated, pulse) for pulse in (0, 4, 5, 13)] == [0, 4, 0, 3]


def test_an_unreadable_image_is_replaced_by_the_one_before_it(tmp_path: Path, folder: Path) -> None:
    for file in folder.glob("*.png"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / "002.png").write_bytes(b"")
    assert all_shown(ImageFolder(str(tmp_path), 0, "stop")) == [0, 1, 1, 3, 4]


def test_a_folder_without_a_readable_image_is_refused(tmp_path: Path) -> None:
    assert "there are no images" in refusal(str(tmp_path))
    (tmp_path / "0.png").write_bytes(b"no image")
    assert "cannot read this image" in refusal(str(tmp_path))
