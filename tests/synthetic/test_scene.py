"""A scene is a pure function of its arguments."""

from __future__ import annotations

import hashlib
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthetic import Scene, scene_names
from synthetic.room.room_world import RoomWorld

SIZE = (320, 180)


def scene(*, cameras: int = 2, objects: int = 4, seed: int = 0, fps: float = 25.0) -> Scene:
    return Scene("room", cameras, objects, seed, *SIZE, fps)


@pytest.fixture(scope="module")
def room() -> Scene:
    return scene()


def test_a_frame_is_identical_in_every_instance_and_order(room: Scene) -> None:
    frames = [0, 3000, 17, 1_000_000, 18]
    forward = [room.image(camera, frame) for camera in range(2) for frame in frames]
    again = scene()
    backward = [again.image(camera, frame) for camera in (1, 0) for frame in reversed(frames)][::-1]
    for one, other in zip(forward, backward, strict=True):
        assert one.shape == (180, 320, 3)
        assert one.dtype == np.uint8
        assert np.array_equal(one, other)


def test_a_frame_is_the_same_in_another_process(room: Scene) -> None:
    script = (
        "import hashlib; from synthetic import Scene;"
        f"picture = Scene('room', 2, 4, 0, {SIZE[0]}, {SIZE[1]}).image(1, 777);"
        "print(hashlib.sha256(picture.tobytes()).hexdigest())"
    )
    process = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
    assert process.stdout.strip() == hashlib.sha256(room.image(1, 777).tobytes()).hexdigest()


def test_modifying_a_picture_does_not_change_the_next(room: Scene) -> None:
    before = room.image(0, 40)
    room.image(0, 40)[:] = 0
    room.clean_background(0)[:] = 0
    assert np.array_equal(room.image(0, 40), before)


def test_cameras_frames_and_seeds_differ(room: Scene) -> None:
    pictures = [room.image(0, 200), room.image(1, 200), room.image(0, 201), scene(seed=1).image(0, 200)]
    for index, one in enumerate(pictures):
        for other in pictures[index + 1 :]:
            assert not np.array_equal(one, other)
    assert not np.allclose(room.ground_positions(200), scene(seed=1).ground_positions(200))


def test_time_is_in_seconds_at_every_frame_rate(room: Scene) -> None:
    assert np.allclose(room.ground_positions(250), scene(fps=10.0).ground_positions(100))


def test_noise_is_mild_and_differs_between_frames() -> None:
    empty = scene(objects=0)
    first, second = (empty.image(0, frame).astype(float) for frame in (10, 11))
    assert 0.5 < np.abs(first - second).mean() < 4
    assert np.abs(first - empty.clean_background(0)).mean() < 5


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"name": "attic"}, "attic"),
        ({"cameras": 0}, "cameras"),
        ({"cameras": 99}, "cameras"),
        ({"objects": -1}, "objects"),
        ({"seed": -1}, "seed"),
        ({"width": 0}, "width"),
        ({"height": 10**6}, "height"),
        ({"fps": 0.0}, "fps"),
        ({"fps": float("nan")}, "fps"),
    ],
)
def test_arguments_out_of_range_are_refused_in_one_line(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        Scene(**arguments)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


def test_a_camera_or_frame_that_does_not_exist_is_refused(room: Scene) -> None:
    with pytest.raises(ValueError, match="no camera 2"):
        room.image(2, 0)
    with pytest.raises(ValueError, match="frame -1"):
        room.truth(-1)


def test_the_names_are_those_that_can_be_built() -> None:
    assert "room" in scene_names()
    for name in scene_names():
        assert Scene(name, cameras=1, objects=1, width=64, height=36).image(0, 0).shape == (36, 64, 3)


@settings(deadline=None, max_examples=40)
@given(camera=st.integers(0, 1), x=st.floats(1.5, 8.0), y=st.floats(1.5, 6.0))
def test_the_homography_undoes_the_projection_of_the_floor(camera: int, x: float, y: float) -> None:
    world = scene().world
    assert isinstance(world, RoomWorld)
    view = world.view(camera)
    pixels, _ = view.project(np.array([[x, y, 0.0]]))
    ground = view.homography() @ (*pixels[0], 1.0)
    assert np.allclose(ground[:2] / ground[2], (x, y), atol=1e-6)
