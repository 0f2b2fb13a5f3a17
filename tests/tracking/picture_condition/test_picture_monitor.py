"""A picture's condition is reported within seconds and taken back; people and light are no fault."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import cv2
import numpy as np
import pytest

from server.messaging.camera_status import CONDITION_TEXTS
from tracking.detectors import Image
from tracking.picture_condition import CONDITIONS, PictureMonitor
from tracking.picture_condition.reference import Reference
from tracking.picture_condition.structure import reduce, structure_of

WIDTH, HEIGHT = 320, 180
FPS = 10.0
KNOWN_S, FAULT_S, AFTER_S = 17.0, 6.0, 6.0
REPORTED_S = 4.0

Change = Callable[[Image, float], Image]
"""Changes a picture; the seconds are those since the change began."""


@cache
def scene(seed: int = 1) -> Image:
    """Return a room full of furniture."""
    random = np.random.default_rng(seed)
    image = np.full((HEIGHT, WIDTH, 3), 120, dtype=np.uint8)
    for _ in range(150):
        x, y = (random.random(2) * (WIDTH, HEIGHT)).astype(int).tolist()
        w, h = random.integers(6, 40, 2).tolist()
        cv2.rectangle(image, (x, y), (x + w, y + h), random.integers(40, 220, 3).tolist(), -1)
    return image


ROOM = scene()
NOISE = np.random.default_rng(1).standard_normal((13, HEIGHT, WIDTH, 3), dtype=np.float32)


def with_noise(image: Image, frame: int, levels: float = 2.0) -> Image:
    """Return a picture with the noise of the sensor."""
    noisy = cv2.add(image, levels * NOISE[frame % len(NOISE)], dtype=cv2.CV_8U)
    return np.asarray(noisy, dtype=np.uint8)


def with_people(image: Image, seconds: float, count: int) -> Image:
    """Return a picture with people who walk to and fro."""
    picture = image.copy()
    for person in range(count):
        x = round((0.5 + 0.5 * np.sin(0.4 * seconds + 2.4 * person)) * WIDTH)
        top = 20 + 7 * (person % 8)
        cv2.rectangle(picture, (x, top), (x + 24, top + 90), (60 + 9 * (person % 15), 70, 80), -1)
        cv2.rectangle(picture, (x + 4, top - 14), (x + 18, top), (150, 170, 200), -1)
    return picture


def conditions(
    change: Change, seconds: float = FAULT_S, *, fps: float = FPS, people: int = 3, room: Image = ROOM
) -> list[tuple[float, str]]:
    """Return the changes of the condition of a room that changes for some seconds, with times since then."""
    monitor, reports = PictureMonitor(fps), []
    last = monitor.condition
    for frame in range(round((KNOWN_S + seconds + AFTER_S) * fps)):
        since = frame / fps - KNOWN_S
        image = with_noise(with_people(room, frame / fps, people), frame)
        if 0.0 <= since < seconds:
            image = change(image, since)
        if monitor.observe(image, frame) != last:
            last = monitor.condition
            reports.append((since, last))
    return reports


def covered(image: Image, seconds: float) -> Image:
    return with_noise(np.full_like(image, 25), round(seconds * FPS))


def sprayed(image: Image, seconds: float) -> Image:
    del seconds
    picture = image.copy()
    for x, y in ((70, 50), (150, 120), (230, 60), (60, 140), (160, 30)):
        cv2.circle(picture, (x, y), 46, (30, 40, 140), -1)
    return with_noise(picture, 7)


def blurred(image: Image, seconds: float) -> Image:
    return with_noise(np.asarray(cv2.GaussianBlur(image, (0, 0), 3.0)), round(seconds * FPS), 1.0)


def turned(image: Image, seconds: float) -> Image:
    del image
    return with_noise(scene(2), round(seconds * FPS))


def dark(image: Image, seconds: float) -> Image:
    return with_noise(np.asarray(image * 0.08, dtype=np.uint8), round(seconds * FPS), 9.0)


def frozen(image: Image, seconds: float) -> Image:
    del image, seconds
    return with_noise(with_people(ROOM, 20.0, 3), 0)


FAULTS = {
    "covered": covered,
    "sprayed": sprayed,
    "blurred": blurred,
    "turned": turned,
    "noisy": dark,
    "frozen": frozen,
}


@pytest.mark.parametrize("fps", [4.0, 12.5])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_reported_within_seconds_and_taken_back(fault: str, fps: float) -> None:
    (reported, condition), (recovered, clear) = conditions(FAULTS[fault], fps=fps)
    assert condition == ("covered" if fault == "sprayed" else fault)
    assert reported <= REPORTED_S
    assert clear == "clear"
    assert recovered - FAULT_S <= REPORTED_S


def bus(image: Image, seconds: float) -> Image:
    """A bus passes in front within four seconds: plain sides, windows."""
    picture = image.copy()
    left = round((seconds / 4.0 * 2.2 - 1.1) * WIDTH)
    cv2.rectangle(picture, (left, 20), (left + WIDTH, 170), (40, 150, 190), -1)
    for window in range(7):
        cv2.rectangle(picture, (left + 12 + 44 * window, 40), (left + 44 + 44 * window, 80), (50, 40, 40), -1)
    return picture


def lamps(image: Image, seconds: float) -> Image:
    """The lamps go off and on again."""
    return np.asarray(image * (0.35 if seconds % 2.0 < 1.0 else 1.0), dtype=np.uint8)


def exposure(image: Image, seconds: float) -> Image:
    """The exposure jumps, and returns slowly."""
    return np.asarray(np.clip(image * (1.0 + 0.9 * np.exp(-seconds / 2.0)), 0, 255), dtype=np.uint8)


def knock(image: Image, seconds: float) -> Image:
    """The camera has been knocked."""
    del seconds
    matrix = cv2.getRotationMatrix2D((WIDTH / 2, HEIGHT / 2), 1.0, 1.0)
    matrix[:, 2] += (5.0, 2.0)
    return np.asarray(cv2.warpAffine(image, matrix, (WIDTH, HEIGHT), borderMode=cv2.BORDER_REFLECT))


def crowd(image: Image, seconds: float) -> Image:
    return with_noise(with_people(image, 3.0 * seconds, 40), round(seconds * FPS))


def close(image: Image, seconds: float) -> Image:
    """Somebody passes close to the lens."""
    picture = image.copy()
    left = round((seconds / 2.0 - 1.0) * WIDTH)
    cv2.rectangle(picture, (left, 0), (left + WIDTH // 2, HEIGHT), (60, 60, 90), -1)
    return picture


@pytest.mark.parametrize("change", [bus, lamps, exposure, knock, crowd, close])
def test_what_passes_and_what_light_does_is_no_fault(change: Change) -> None:
    assert conditions(change, 8.0) == []


def test_the_same_picture_of_a_room_without_noise_is_not_frozen() -> None:
    monitor = PictureMonitor(FPS)
    assert {monitor.observe(with_people(ROOM, min(t / FPS, 15.0), 3), t) for t in range(600)} == {"clear"}


def test_a_plain_scene_is_not_judged() -> None:
    wall = np.full_like(ROOM, 140)
    assert (
        conditions(lambda image, _: np.asarray(cv2.GaussianBlur(image, (0, 0), 3.0)), room=wall, people=0)
        == []
    )


@pytest.mark.parametrize(("level", "flat_s", "levels"), [(0, 5.0, 0.0), (128, 1.5, 2.0), (255, 40.0, 2.0)])
def test_a_camera_that_shows_nothing_at_first_is_not_blurred(
    level: int, flat_s: float, levels: float
) -> None:
    monitor, fps, shown = PictureMonitor(5.0), 5.0, set()
    for frame in range(round((flat_s + 40.0) * fps)):
        is_flat = frame < flat_s * fps
        image = np.full_like(ROOM, level) if is_flat else with_people(ROOM, frame / fps, 3)
        shown.add(monitor.observe(image if is_flat else with_noise(image, frame, levels), frame))
    assert shown == {"clear"}
    for index in range(round(FAULT_S * fps)):
        monitor.observe(blurred(ROOM, index / fps))
    assert monitor.condition == "blurred"


def test_sharpness_is_not_learned_from_what_is_hidden() -> None:
    reference = Reference(structure_of(reduce(ROOM)))
    paint, hidden = ROOM.copy(), np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    paint[:, : WIDTH * 3 // 4], hidden[:, : WIDTH * 3 // 4] = 40, True
    for _ in range(50):
        reference.learn(structure_of(reduce(paint)), 0.1, hidden)
    soft = structure_of(reduce(np.asarray(cv2.GaussianBlur(ROOM, (0, 0), 3.0))))
    assert reference.sign(soft, soft, 0.0, 0.0) == "blurred"


def test_a_camera_that_stays_turned_is_accepted_after_minutes() -> None:
    reports = conditions(turned, 310.0, fps=2.0)
    assert [condition for _, condition in reports][:2] == ["turned", "clear"]
    assert 300.0 <= reports[1][0] <= 310.0


@pytest.mark.parametrize("is_located", [False, True])
def test_an_accepted_scene_is_another_one_until_it_is_located(*, is_located: bool) -> None:
    monitor, fps = PictureMonitor(2.0), 2.0
    for frame in range(round((KNOWN_S + 310.0) * fps)):
        image = with_noise(with_people(ROOM, frame / fps, 3), frame)
        monitor.observe(image if frame < KNOWN_S * fps else turned(image, frame / fps), frame)
        if is_located and monitor.condition == "turned":
            monitor.accept_scene()
            assert monitor.condition == "clear"
    assert (monitor.condition, monitor.shows_now) == ("clear", True)
    assert monitor.shows_another_scene is not is_located


def test_the_conditions_are_those_of_the_messages() -> None:
    assert tuple(CONDITION_TEXTS) == CONDITIONS
