"""Boxes are converted to arrays exactly."""

from __future__ import annotations

import msgspec
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from server.messaging.messages import Box
from server.service.ingest.box_arrays import boxes_array

SIDE = st.floats(-1e6, 1e6)
BOXES = st.lists(st.lists(st.tuples(SIDE, SIDE, SIDE, SIDE) | st.none(), max_size=20), max_size=6)


@settings(deadline=None, max_examples=100)
@given(BOXES)
def test_boxes_are_converted_exactly_and_hidden_ones_are_nan(sent: list[list[Box | None]]) -> None:
    decoded = msgspec.json.decode(msgspec.json.encode(sent), type=list[list[Box | None]])
    expected = [box or (np.nan,) * 4 for boxes in sent for box in boxes]
    assert np.array_equal(boxes_array(decoded), np.array(expected).reshape(-1, 4), equal_nan=True)


def test_any_number_of_boxes_is_converted() -> None:
    for count in (0, 1, 15, 16, 65_535, 65_536):
        boxes: list[Box | None] = [(1.0, 2.0, 3.0, float(number)) for number in range(count)]
        assert boxes_array([boxes])[:, 3].tolist() == list(range(count))


def test_integer_coordinates_are_converted() -> None:
    assert boxes_array([[(1, 2, 3.5, 4), None]])[0].tolist() == [1.0, 2.0, 3.5, 4.0]
    assert boxes_array([[(2**40, 2**41, 2**42, 2**43)]]).tolist() == [
        [2.0**number for number in range(40, 44)]
    ]
