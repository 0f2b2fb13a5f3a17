"""A person out of focus is less sharp at any size and brightness; a hidden one keeps their sharpness."""

from __future__ import annotations

import cv2
import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from fakes.service.scripted_cameras import camera_tracks
from server.camera.sharpness import SharpnessMemory, sharpness
from server.messaging.messages import Box

BOX: Box = (20.0, 10.0, 84.0, 138.0)


def picture(blur: float = 0.0, contrast: float = 1.0) -> NDArray[np.uint8]:
    """Return a picture full of stripes and spots."""
    rng = np.random.default_rng(4)
    coarse = cv2.resize(rng.uniform(60, 200, (12, 8)), (120, 160), interpolation=cv2.INTER_NEAREST)
    grey = 128 + contrast * (coarse + rng.normal(0, 10, (160, 120)) - 128)
    if blur:
        grey = cv2.GaussianBlur(grey, (0, 0), blur)
    return np.repeat(np.clip(grey, 0, 255).astype(np.uint8)[:, :, None], 3, axis=2)


def test_sharpness_falls_with_blur() -> None:
    values = [sharpness(picture(blur), BOX) or 0.0 for blur in (0.0, 2.0, 4.0, 8.0)]
    assert values == sorted(values, reverse=True)
    assert values[0] > 0.5 > values[2]
    assert all(0 <= value <= 1 for value in values)


def test_sharpness_hardly_depends_on_contrast_and_size() -> None:
    plain, faint = sharpness(picture(), BOX), sharpness(picture(contrast=0.5), BOX)
    twice = cv2.resize(picture(), None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)
    large = sharpness(twice, (40.0, 20.0, 168.0, 276.0))
    assert faint == pytest.approx(plain, abs=0.05)
    assert large == pytest.approx(plain, abs=0.05)


@pytest.mark.parametrize("box", [(0.0, 0.0, 3.0, 90.0), (-40.0, 10.0, 2.0, 90.0), (300.0, 10.0, 340.0, 90.0)])
def test_tiny_boxes_have_no_sharpness(box: Box) -> None:
    assert sharpness(picture(), box) is None


def test_a_hidden_track_keeps_its_sharpness_and_an_ended_one_is_forgotten() -> None:
    memory = SharpnessMemory()
    [visible] = memory.measure(camera_tracks("c0", 0, {1: BOX}), picture()).tracks
    assert visible.sharpness == sharpness(picture(), BOX)
    hidden = memory.measure(camera_tracks("c0", 1, {1: None, 2: None}), picture(blur=5.0)).tracks
    assert [track.sharpness for track in hidden] == [visible.sharpness, None]
    [undecoded] = memory.measure(camera_tracks("c0", 2, {1: BOX}), None).tracks
    assert undecoded.sharpness == visible.sharpness
    memory.measure(camera_tracks("c0", 3, {}), picture())
    [reappeared] = memory.measure(camera_tracks("c0", 4, {1: None}), picture()).tracks
    assert reappeared.sharpness is None


def test_other_fields_of_the_message_are_unchanged() -> None:
    message = camera_tracks("c0", 0, {1: BOX})
    measured = SharpnessMemory().measure(message, picture())
    without_sharpness = [msgspec.structs.replace(track, sharpness=None) for track in measured.tracks]
    assert msgspec.structs.replace(measured, tracks=without_sharpness) == message
