"""`myview track --template` tracks the contents of boxes in the first picture, or prints an error."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from av.video.stream import VideoStream

from server.cli.track.templates import boxes_from, track_templates
from server.system.errors import UserError
from tracking.motchallenge import read_rows

FRAMES, SPEED, SIDE = 12, 3, 32
FIRST = (20, 40)


@pytest.fixture
def video(tmp_path: Path) -> Path:
    """Write a video of a patch that moves right before a smooth background."""
    rng = np.random.default_rng(0)
    coarse = [rng.integers(0, 256, shape, dtype=np.uint8) for shape in ((6, 9, 3), (5, 5, 3))]
    ground = cv2.resize(coarse[0], (192, 128), interpolation=cv2.INTER_CUBIC)
    patch = cv2.resize(coarse[1], (SIDE, SIDE), interpolation=cv2.INTER_CUBIC)
    path = tmp_path / "toy.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25)
        assert isinstance(stream, VideoStream)
        stream.width, stream.height, stream.pix_fmt = 192, 128, "yuv420p"
        stream.options = {"preset": "veryfast", "crf": "8"}
        for number in range(FRAMES):
            picture = ground.astype(np.uint8)
            left = FIRST[0] + SPEED * number
            picture[FIRST[1] : FIRST[1] + SIDE, left : left + SIDE] = patch
            frame = av.VideoFrame.from_ndarray(picture, format="bgr24")
            frame.pts, frame.time_base = number, Fraction(1, 25)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def follow(video: Path, text: str, **other: str) -> int:
    out = video.parent / "t.txt"
    return track_templates(video, boxes_from([text]), out, None, other.get("solver"), lambda _done: None)


def test_the_object_is_tracked_in_every_frame(video: Path) -> None:
    assert follow(video, f"{FIRST[0]},{FIRST[1]},{SIDE},{SIDE}") == 1
    rows = read_rows(video.parent / "t.txt")
    assert [row.frame for row in rows] == list(range(1, FRAMES + 1))
    lefts = np.array([row.left for row in rows])
    np.testing.assert_allclose(lefts, FIRST[0] + SPEED * np.arange(FRAMES), atol=1.0)
    assert {(row.id, row.width, row.height) for row in rows} == {(1, SIDE, SIDE)}


@pytest.mark.parametrize("text", ["1,2,3", "a,b,c,d", "-1,0,10,10", "0,0,0,10", ""])
def test_an_invalid_box_is_refused(text: str) -> None:
    with pytest.raises(UserError, match="LEFT,TOP,WIDTH,HEIGHT"):
        boxes_from([text])


@pytest.mark.parametrize(
    ("text", "reason"), [("180,40,32,32", "is not inside the 192x128"), ("20,40,2,32", "4 pixels a side")]
)
def test_a_box_that_cannot_be_tracked_is_refused_and_nothing_is_written(
    video: Path, text: str, reason: str
) -> None:
    with pytest.raises(UserError, match=reason):
        follow(video, text)
    assert not (video.parent / "t.txt").exists()


def test_an_unknown_solver_is_refused(video: Path) -> None:
    with pytest.raises(UserError, match="there is no solver 'oracle'"):
        follow(video, "20,40,32,32", solver="oracle")
