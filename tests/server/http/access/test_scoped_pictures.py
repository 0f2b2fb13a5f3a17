"""Stills, MJPEG and drawn boxes for a token limited to one person, rendered by real processes."""

from __future__ import annotations

import io
from contextlib import aclosing
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from fakes.http.tokens import bearer, token_entry, write_tokens
from fakes.service.departure import GRAY, departure_site, feed_epochs, fetch, open_stream
from fakes.service.drawn_site import DrawnSite, Image, drawn_room, jpeg_parts, read_film
from fakes.service.scripted_cameras import GOP

NEARLY = 3
"""Tolerance of an encoded picture, in gray levels."""


def is_nearly_grey(image: Image) -> bool:
    return bool(np.abs(image.astype(np.int16) - GRAY).max() <= NEARLY)


def picture_of(jpeg: bytes) -> Image:
    return np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR), np.uint8)


@pytest.mark.parametrize("query", ["", "?overlay=1"])
async def test_scoped_pictures_are_gray_without_the_person(tmp_path: Path, query: str) -> None:
    async with departure_site(tmp_path) as served:
        feed_epochs(served, range(12))
        scoped = picture_of(await fetch(served, f"/objects/1/best.jpg{query}", "family"))
        unscoped = picture_of(await fetch(served, f"/objects/1/best.jpg{query}", "desk"))
        async with (
            await open_stream(served, f"/objects/1/best.mjpeg{query}", "family") as series,
            aclosing(jpeg_parts(series)) as shown,
        ):
            feed_epochs(served, range(12, 14))
            several = [picture_of((await anext(shown)).jpeg) for _ in range(2)]
    assert is_nearly_grey(scoped)
    assert not is_nearly_grey(unscoped)
    assert all(map(is_nearly_grey, several))


async def test_a_scoped_stream_with_boxes_is_gray_without_the_person(tmp_path: Path) -> None:
    async with departure_site(tmp_path) as served:
        feed_epochs(served, range(12))
        async with await open_stream(served, "/objects/1/best.mp4?overlay=1", "family") as film:
            feed_epochs(served, range(12, 15))
            data = await read_film(film, 3 * GOP)
    with av.open(io.BytesIO(data), "r") as stream:
        pictures = [frame.to_ndarray(format="bgr24") for frame in stream.decode(video=0)]
    assert len(pictures) >= 3 * GOP
    assert all(map(is_nearly_grey, pictures))


async def test_only_the_box_of_the_scoped_person_is_drawn(tmp_path: Path) -> None:
    path = write_tokens(tmp_path / "tokens.yaml", token_entry("family"), token_entry("desk"))
    async with aclosing(drawn_room(access={"tokens": str(path)})) as rooms:
        room = await anext(rooms)
        decision = room.decisions[max(room.decisions)]
        boxes = decision.boxes[decision.choices[1]][-1]
        plain = await still(room, "", "desk")
        scoped, unscoped_image = [
            await still(room, "?overlay=1", token_name) for token_name in ("family", "desk")
        ]
    assert len(boxes) > 1, "another person is in the picture"
    for number, *box in boxes:
        assert has_box(unscoped_image, plain, box)
        assert has_box(scoped, plain, box) == (number == 1)


async def still(room: DrawnSite, query: str, token_name: str) -> Image:
    async with room.session.get(f"/objects/1/best.jpg{query}", headers=bearer(token_name)) as answer:
        assert answer.status == 200
        return picture_of(await answer.read())


def has_box(image: Image, plain: Image, box: list[float]) -> bool:
    """Return whether a picture differs from the plain one along most of a box's left and right edges."""
    left, top, right, bottom = (round(edge) for edge in box)
    changed = np.abs(image.astype(np.int16) - plain).max(axis=2) > 30
    sides = [changed[max(0, top) : bottom, max(0, x - 1) : x + 2].any(axis=1) for x in (left, right - 1)]
    return bool(np.concatenate(sides).mean() > 0.5)
