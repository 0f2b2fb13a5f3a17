"""Images are upright, with square pixels, and all of one size."""

from __future__ import annotations

import http.server
import threading
from collections.abc import Iterator
from fractions import Fraction
from functools import partial
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from av.stream import Disposition
from av.video.stream import VideoStream
from numpy.typing import NDArray
from PIL import Image as Pillow

from fakes.cli.command_line import RunCommand, myview
from fakes.media.videos import frame_in, write_timed, write_video
from server.camera.passthrough.compatibility import IncompatibleStreamError, RequiredFormat
from server.camera.passthrough.recording_source import PassthroughRecording
from server.camera.passthrough.stream_source import PassthroughStream
from server.camera.sources import ImageFolder, Recording
from server.camera.sources.live_stream import LiveStream
from server.cli.generated_config import config_for_videos
from server.cli.render.video_info import read_video_info
from server.media.h264.codec import H264
from tracking.motchallenge import MotRow, read_rows, write_rows

__all__ = ["myview"]

WIDE, HIGH = 96, 64
ORIENTATIONS = [(turn, flip) for turn in (0, 90, 180, 270) for flip in (False, True)]
"""Rotations to the left, in degrees, and whether the picture is mirrored afterwards."""
SITE = RequiredFormat((WIDE, HIGH), 25.0, 10, H264, None)

Picture = NDArray[np.uint8]


def corners() -> Picture:
    """Draw a picture whose quarters have different grays, so that rotations and mirrorings differ."""
    picture = np.zeros((HIGH, WIDE, 3), np.uint8)
    for (row, column), grey in {(0, 0): 40, (0, 1): 100, (1, 0): 160, (1, 1): 220}.items():
        picture[row * HIGH // 2 :, column * WIDE // 2 :] = grey
    return picture


def turn_picture(picture: Picture, turn: int, *, flip: bool) -> Picture:
    rotated = np.rot90(picture, turn // 90)
    return rotated[:, ::-1] if flip else rotated


def is_same(shown: Picture | None, expected: Picture) -> bool:
    return (
        shown is not None
        and shown.shape == expected.shape
        and bool(np.abs(shown - expected.astype(int)).mean() < 8)
    )


def write_film(
    path: Path, turn: int = 0, *, flip: bool = False, frames: int = 20, aspect: str = "1:1"
) -> Path:
    def prepare(stream: VideoStream) -> None:
        if turn or flip:
            stream.set_display_rotation(turn, hflip=flip)
        stream.codec_context.sample_aspect_ratio = Fraction(aspect.replace(":", "/"))
        stream.options = {"preset": "veryfast", "crf": "8", "bf": "0", "g": "10", "sc_threshold": "0"}

    return write_timed(path, [n / 25 for n in range(frames)], pictures=frames * [corners()], prepare=prepare)


@pytest.mark.parametrize("suffix", ["mp4", "mkv"])
@pytest.mark.parametrize(("turn", "flip"), ORIENTATIONS)
def test_the_display_matrix_is_applied_to_a_recording(
    tmp_path: Path, suffix: str, turn: int, flip: bool
) -> None:
    path = write_film(tmp_path / f"phone.{suffix}", turn, flip=flip, frames=3)
    expected = turn_picture(corners(), turn, flip=flip)
    recording = Recording(str(path))
    assert recording.size == (expected.shape[1], expected.shape[0]) == read_video_info(path).size
    assert is_same(recording.take(0), expected)
    assert all(is_same(image, expected) for image in recording.prescan_images(range(3)))
    recording.close()


def test_a_site_is_as_high_as_its_upright_first_view(tmp_path: Path) -> None:
    site = config_for_videos([write_film(tmp_path / "phone.mp4", 90, frames=2)]).site
    assert (site.width, site.height) == (HIGH, WIDE)


def test_tracks_of_a_turned_video_are_in_the_upright_picture(tmp_path: Path, myview: RunCommand) -> None:
    """The detections are in the upright picture, as of a program that applies the rotation."""
    video = write_film(tmp_path / "phone.mp4", 90, frames=30)
    write_rows(tmp_path / "det.txt", [MotRow(n + 1, -1, 20.0, 30.0 + n, 20.0, 30.0, 1.0) for n in range(30)])
    result = myview("track", video, "--det", tmp_path / "det.txt", "--out", tmp_path / "tracks.txt")
    assert result.code == 0, result.err
    rows = read_rows(tmp_path / "tracks.txt")
    assert len(rows) == 30
    assert max(row.top + row.height for row in rows) > HIGH, "below the stored picture"


@pytest.mark.parametrize("aspect", ["2:1", "3:4"])
def test_pictures_are_scaled_to_square_pixels(tmp_path: Path, aspect: str) -> None:
    path = write_film(tmp_path / "dv.mp4", frames=2, aspect=aspect)
    width = round(WIDE * Fraction(aspect.replace(":", "/")))
    recording = Recording(str(path))
    assert recording.size == (width, HIGH) == read_video_info(path).size
    assert is_same(recording.take(0), cv2.resize(corners(), (width, HIGH)))
    recording.close()


@pytest.mark.parametrize(
    ("turn", "aspect", "reason"),
    [
        (90, "1:1", "it is shown rotated or mirrored"),
        (180, "1:1", "it is shown rotated or mirrored"),
        (0, "4:3", r"it is shown stretched \(its pixels are 1.33 times as wide as high\)"),
    ],
)
def test_rotated_or_stretched_video_is_not_passed_through(
    tmp_path: Path, folder_url: str, turn: int, aspect: str, reason: str
) -> None:
    path = write_film(tmp_path / "own.mkv", turn, aspect=aspect, frames=40)
    with pytest.raises(IncompatibleStreamError, match=reason):
        PassthroughRecording(str(path), 0, "stop", SITE)
    with pytest.raises(IncompatibleStreamError, match=reason):
        PassthroughStream(f"{folder_url}/own.mkv", {}, None, SITE)


def test_upright_video_is_passed_through(tmp_path: Path) -> None:
    PassthroughRecording(str(write_film(tmp_path / "own.mp4")), 0, "stop", SITE).close()


@pytest.fixture
def folder_url(tmp_path: Path) -> Iterator[str]:
    """The address of an HTTP server of the test's folder."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path)))
    thread = threading.Thread(target=server.serve_forever, args=(0.02,))
    thread.start()
    yield f"http://127.0.0.1:{server.server_address[1]}"
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.mark.parametrize("turn", [90, 180])
def test_a_stream_is_shown_upright_from_its_first_picture_on(
    tmp_path: Path, folder_url: str, turn: int
) -> None:
    write_film(tmp_path / "camera.mkv", turn)
    expected = turn_picture(corners(), turn, flip=False)
    source = LiveStream(f"{folder_url}/camera.mkv", {})
    try:
        assert source.size == (expected.shape[1], expected.shape[0])
        assert is_same(source.take(0), expected)
    finally:
        source.close()


def test_a_change_of_size_is_letterboxed_and_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "changes.mjpeg"
    sizes = [(HIGH, WIDE), (HIGH, WIDE), (WIDE, HIGH), (2 * HIGH, 2 * WIDE)]
    greys = [np.full((*size, 3), 200, np.uint8) for size in sizes]
    path.write_bytes(b"".join(cv2.imencode(".jpg", grey)[1].tobytes() for grey in greys))
    recording = Recording(str(path))
    images = [recording.take(n) for n in range(4)]
    recording.close()
    assert [None if image is None else image.shape for image in images] == 4 * [(HIGH, WIDE, 3)]
    upright = images[2]
    assert upright is not None
    assert [round(float(upright[:, x].mean()), -2) for x in (2, WIDE // 2, -2)] == [0, 200, 0], "undistorted"
    assert caplog.messages[-1] == (
        f"{path}: its images are {HIGH}x{WIDE} from frame 3 on, they were {WIDE}x{HIGH}: "
        "letterboxed to that size"
    )


def test_cover_art_is_skipped_and_the_first_video_stream_is_used(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "two.mkv"
    with av.open(str(path), "w") as container:
        streams = []
        for size, codec in ((32, "mjpeg"), (64, "mpeg4"), (48, "mpeg4")):
            stream = container.add_stream(codec, rate=25)
            assert isinstance(stream, VideoStream)
            stream.width = stream.height = size
            stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
            streams.append(stream)
        streams[0].disposition = Disposition.attached_pic
        for stream in streams:
            grey = np.full((stream.height, stream.width, 3), 100, np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(grey, format="bgr24")))
            container.mux(stream.encode(None))
    with av.open(str(path)) as container:
        covers = sum(
            bool(stream.disposition & Disposition.attached_pic) for stream in container.streams.video
        )
    recording = Recording(str(path))
    recording.close()
    assert recording.size == ((64, 64) if covers else (32, 32))
    assert caplog.messages == [f"{path} contains {3 - covers} video streams: the first is used"]


def test_h264_cropping_is_applied(tmp_path: Path) -> None:
    pictures = 3 * [np.full((38, 50, 3), 100, np.uint8)]  # stored as 64x48
    recording = Recording(str(write_timed(tmp_path / "odd.mp4", [0, 0.04, 0.08], pictures=pictures)))
    image = recording.take(0)
    recording.close()
    assert image is not None
    assert recording.size == (50, 38)
    assert image.shape == (38, 50, 3)
    assert abs(float(image.mean()) - 100) < 4


def test_interlaced_video_is_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    def interlaced(stream: VideoStream) -> None:
        stream.options = {"x264-params": "tff=1"}

    path = write_timed(tmp_path / "tape.mp4", [n / 25 for n in range(4)], prepare=interlaced)
    Recording(str(path)).close()
    (line,) = caplog.messages
    assert line.startswith(f"{path}: it is interlaced")


@pytest.mark.parametrize("suffix", ["jpg", "png", "tif", "webp"])
@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_the_exif_orientation_of_an_image_is_applied(tmp_path: Path, suffix: str, orientation: int) -> None:
    exif = Pillow.Exif()
    exif[274] = orientation
    Pillow.fromarray(corners()).save(tmp_path / f"0.{suffix}", exif=exif)
    expected = turn_picture(corners(), {1: 0, 3: 180, 6: 270, 8: 90}[orientation], flip=False)
    folder = ImageFolder(str(tmp_path), 0, "stop")
    assert folder.size == (expected.shape[1], expected.shape[0])
    assert is_same(folder.take(0), expected)
    assert read_video_info(tmp_path).size == folder.size


def test_images_of_any_bit_depth_and_format_are_read(tmp_path: Path) -> None:
    grey = np.full((HIGH, WIDE), 120, np.uint8)
    kinds = {
        "grey": grey,
        "alpha": np.dstack([grey, grey, grey, np.zeros_like(grey)]),
        "deep": grey.astype(np.uint16) * 257,
    }
    for name, image in kinds.items():
        cv2.imwrite(str(tmp_path / f"{name}.png"), image)
    Pillow.fromarray(grey).convert("P").save(tmp_path / "palette.png")
    folder = ImageFolder(str(tmp_path), 0, "stop")
    for number in range(4):
        assert is_same(folder.take(number), np.dstack([grey, grey, grey]))


def test_images_of_several_sizes_are_letterboxed_and_logged(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for number, (high, wide) in enumerate([(HIGH, WIDE), (WIDE, HIGH), (HIGH, WIDE)]):
        cv2.imwrite(str(tmp_path / f"{number}.png"), np.full((high, wide, 3), 200, np.uint8))
    folder = ImageFolder(str(tmp_path), 0, "stop")
    images = [folder.take(number) for number in range(3)]
    assert [None if image is None else image.shape for image in images] == 3 * [(HIGH, WIDE, 3)]
    upright = images[1]
    assert upright is not None
    assert [int(upright[HIGH // 2, x, 0]) for x in (2, WIDE // 2, -2)] == [0, 200, 0]
    first = tmp_path / "1.png"
    assert caplog.messages == [
        f"{first} is {HIGH}x{WIDE}, the first image {WIDE}x{HIGH}: all images are letterboxed to that size"
    ]


def test_unreadable_images_are_counted_and_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    for number in range(5):
        cv2.imwrite(str(tmp_path / f"{number}.png"), np.full((HIGH, WIDE, 3), 200, np.uint8))
    for number in (1, 2, 4):
        (tmp_path / f"{number}.png").write_bytes(b"no image")
    folder = ImageFolder(str(tmp_path), 0, "loop")
    for number in range(12):
        folder.take(number)
    folder.close()
    assert caplog.messages == [
        f"{tmp_path}: 3 damaged frames are replaced by the previous one: frames 2 to 3, 5"
    ]


def test_without_site_settings_size_and_rate_are_those_of_the_first_view(tmp_path: Path) -> None:
    """A folder of images has a size, and no rate."""
    (tmp_path / "images").mkdir()
    cv2.imwrite(str(tmp_path / "images" / "0.png"), np.zeros((HIGH, WIDE + 1, 3), np.uint8))
    video = write_video(tmp_path / "video.mp4", 3, fps=30)
    alone = config_for_videos([tmp_path / "images"]).site
    assert (alone.fps, alone.width, alone.height) == (25.0, WIDE, HIGH)
    beside = config_for_videos([tmp_path / "images", video]).site
    assert (beside.fps, beside.width, beside.height) == (30.0, WIDE, HIGH)


def test_an_animated_gif_is_a_video(tmp_path: Path) -> None:
    frames = [Pillow.fromarray(np.full((48, 64), 10 * n, np.uint8)) for n in range(6)]
    frames[0].save(tmp_path / "a.gif", save_all=True, append_images=frames[1:], duration=80)
    recording = Recording(str(tmp_path / "a.gif"), fps=25.0)
    images = [recording.take(n) for n in range(12)]
    recording.close()
    assert [frame_in(image) for image in images if image is not None] == [n // 2 for n in range(12)]
