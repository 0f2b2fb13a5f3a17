"""A covered part of the lens is found in the pictures alone; people, fog and compression are no cover."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import cv2
import numpy as np
import pytest

from tracking.boxes import Floats, areas, iou
from tracking.detectors import Image
from tracking.picture_condition import PictureMonitor, cell_rectangles, cells_of
from tracking.picture_condition.structure import structure_of

WIDTH, HEIGHT, FPS = 320, 180, 5.0
KNOWN_S = 16.0
PAINT = np.array([[0.0, 0.0, 130.0, 180.0]])

Change = Callable[[Image, float], Image]
"""Changes a picture; the seconds are those since the change began."""


@cache
def room() -> Image:
    """Return a room full of furniture."""
    random = np.random.default_rng(1)
    image = np.full((HEIGHT, WIDTH, 3), 120, dtype=np.uint8)
    for _ in range(200):
        x, y = (random.random(2) * (WIDTH, HEIGHT)).astype(int).tolist()
        w, h = random.integers(6, 40, 2).tolist()
        cv2.rectangle(image, (x, y), (x + w, y + h), random.integers(40, 220, 3).tolist(), -1)
    return image


def covered_boxes(monitor: PictureMonitor) -> Floats:
    cells = monitor.covered
    return np.empty((0, 4)) if cells is None else cell_rectangles(cells, (WIDTH, HEIGHT))


def noisy(image: Image, frame: int, levels: float = 2.0) -> Image:
    noise = np.random.default_rng(frame).standard_normal(image.shape, dtype=np.float32)
    return np.asarray(np.clip(image + levels * noise + 0.5, 0, 255), dtype=np.uint8)


def watch(monitor: PictureMonitor, change: Change, seconds: float, begin: float = 0.0) -> list[float]:
    """Show a changed room for some seconds; return the covered share of the picture after each frame."""
    shares = []
    for frame in range(round(begin * FPS), round((begin + seconds) * FPS)):
        monitor.observe(noisy(change(room(), frame / FPS - begin), frame), frame)
        shares.append(float(areas(covered_boxes(monitor)).sum()) / (WIDTH * HEIGHT))
    return shares


def known_room() -> PictureMonitor:
    monitor = PictureMonitor(FPS)
    assert set(watch(monitor, lambda image, _: image, KNOWN_S)) == {0.0}
    return monitor


def painted(image: Image, seconds: float) -> Image:
    """Paint on the left of the lens, with a soft edge."""
    del seconds
    share = np.clip((130.0 - np.arange(WIDTH)) / 10.0 + 0.5, 0.0, 1.0)[:, None]
    return np.asarray(image + (np.array([40.0, 60.0, 150.0]) - image) * share, dtype=np.uint8)


def dim(image: Image, seconds: float) -> Image:
    return np.asarray(painted(image, seconds) * 0.5, dtype=np.uint8)


@pytest.mark.parametrize("change", [painted, dim])
def test_the_covered_part_is_found_at_once_and_is_seen_again_when_it_clears(change: Change) -> None:
    monitor = known_room()
    shares = watch(monitor, change, 8.0, KNOWN_S)
    assert shares[1] > 0.3
    covered = covered_boxes(monitor)
    hull = np.array([[*covered[:, :2].min(axis=0), *covered[:, 2:].max(axis=0)]])
    assert iou(hull, PAINT)[0] > 0.85
    assert areas(covered).sum() > 0.9 * areas(PAINT)[0], "they are beside each other"
    assert monitor.shows_now, "in the rest of the picture"
    assert watch(monitor, lambda image, _: image, 1.0, KNOWN_S + 8.0)[-1] == 0.0


def test_what_was_covered_is_known_after_a_long_time() -> None:
    monitor = known_room()
    assert watch(monitor, painted, 90.0, KNOWN_S)[-1] > 0.3
    assert watch(monitor, lambda image, _: image, 1.0, KNOWN_S + 90.0)[-1] == 0.0


def test_a_small_part_is_covered_after_seconds() -> None:
    def dropped(image: Image, seconds: float) -> Image:
        del seconds
        picture = image.copy()
        cv2.circle(picture, (220, 90), 42, (30, 40, 140), -1)
        shares = cv2.GaussianBlur((picture != image).any(axis=2).astype(np.float32), (0, 0), 3.0)[:, :, None]
        return np.asarray(image + (np.array([30.0, 40.0, 140.0]) - image) * shares, dtype=np.uint8)

    shares = watch(known_room(), dropped, 6.0, KNOWN_S)
    assert shares[round(2.0 * FPS)] == 0.0
    assert shares[round(4.0 * FPS)] > 0.06


def test_the_share_of_a_cover_is_reported_once_it_has_lasted_until_it_has_been_gone() -> None:
    def passing(image: Image, seconds: float) -> Image:
        return painted(image, seconds) if seconds < 1.0 or 6.0 <= seconds < 16.0 else image

    monitor, reported = known_room(), {}
    for frame in range(round(KNOWN_S * FPS), round((KNOWN_S + 22.0) * FPS)):
        seconds = round(frame / FPS - KNOWN_S, 1)
        monitor.observe(noisy(passing(room(), seconds), frame), frame)
        reported[seconds] = monitor.covered_share
    assert {share for seconds, share in reported.items() if seconds < 8.5} == {0.0}, "a bird is no cover"
    assert [reported[seconds] for seconds in (10.0, 15.0)] == pytest.approx([0.43, 0.43], abs=0.05)
    assert reported[17.0] > 0.0
    assert {share for seconds, share in reported.items() if seconds >= 19.0} == {0.0}
    assert monitor.condition == "clear"


def test_a_wholly_covered_lens_shows_nothing() -> None:
    monitor = known_room()
    watch(monitor, lambda image, _: np.full_like(image, 20), 5.0, KNOWN_S)
    assert (monitor.condition, monitor.shows_now) == ("covered", False)


def people_who_stand(image: Image, seconds: float) -> Image:
    """Three people in plain coats who stand about, one of them near."""
    picture = image.copy()
    sway = round(1.5 * np.sin(seconds))
    for left, top, width, height in ((40, 60, 26, 90), (110, 50, 34, 115), (200, 10, 60, 165)):
        x = left + sway
        cv2.rectangle(picture, (x, top + height // 6), (x + width, top + height), (50, 50, 60), -1)
        cv2.rectangle(
            picture, (x + width // 3, top), (x + 2 * width // 3, top + height // 6), (150, 170, 200), -1
        )
        cv2.rectangle(picture, (x + 2, top + height // 2), (x + width - 2, top + height), (120, 60, 50), -1)
    return picture


def fog(image: Image, seconds: float) -> Image:
    density = min(seconds / 4.0, 1.0) * np.linspace(0.7, 0.3, HEIGHT)[:, None, None]
    return np.asarray(image + (190.0 - image) * density, dtype=np.uint8)


def coarse(image: Image, seconds: float) -> Image:
    """A stream with so few bits that weak edges are lost."""
    del seconds
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 5])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), dtype=np.uint8)


def night(image: Image, seconds: float) -> Image:
    return noisy(np.asarray(image * 0.2, dtype=np.uint8), round(FPS * seconds) + 5, 8.0)


@pytest.mark.parametrize("change", [people_who_stand, fog, coarse, night])
def test_what_does_not_cover_the_lens_is_no_cover(change: Change) -> None:
    assert set(watch(known_room(), change, 12.0, KNOWN_S)) == {0.0}


def test_a_picture_that_stands_still_shows_nothing_from_half_a_second_on_until_it_moves() -> None:
    monitor, frozen = known_room(), noisy(room(), 3)
    shown = []
    for frame in range(round(KNOWN_S * FPS), round((KNOWN_S + 8.0) * FPS)):
        seconds = frame / FPS - KNOWN_S
        monitor.observe(frozen if seconds < 5.0 else noisy(room(), frame), frame)
        shown.append((seconds, monitor.shows_now))
    assert not any(is_shown for seconds, is_shown in shown if 1.0 <= seconds < 5.0)
    assert all(is_shown for seconds, is_shown in shown if seconds >= 5.2)


def test_pictures_of_every_shape_have_one_grid() -> None:
    plane = np.arange(320.0 * 320.0, dtype=np.float32).reshape(320, 320) % 251.0
    for side in range(48, 321):
        for gray in (plane[:side], plane[:, :side]):
            structure = structure_of(np.ascontiguousarray(gray))
            assert structure.edges.shape == structure.detail.shape, gray.shape


@pytest.mark.parametrize("size", [(320, 185), (185, 320), (640, 410), (4096, 1860), (320, 245), (320, 125)])
def test_a_cover_is_found_in_pictures_of_any_shape(size: tuple[int, int]) -> None:
    monitor = PictureMonitor(FPS)
    room_here = np.asarray(cv2.resize(room(), size), dtype=np.uint8)
    covered = np.asarray(cv2.resize(painted(room(), 0.0), size), dtype=np.uint8)
    for frame in range(round(6.0 * FPS)):
        shown = covered if frame >= 4.0 * FPS else room_here
        monitor.observe(noisy(shown, frame) if max(size) <= WIDTH else shown, frame)
    cells = monitor.covered
    assert cells is not None
    assert areas(cell_rectangles(cells, size)).sum() == pytest.approx(0.4 * size[0] * size[1], rel=0.25)


def test_what_flickers_lies_in_the_grid_of_a_cover() -> None:
    mask = np.zeros((491, 640), dtype=np.uint8)
    mask[:, :320] = 255
    assert cells_of(mask).shape == (25, 32)
    assert cells_of(mask, (24, 32)).tolist() == [[True] * 16 + [False] * 16] * 24
