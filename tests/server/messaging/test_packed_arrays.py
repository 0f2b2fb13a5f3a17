"""Boxes and histograms are packed exactly enough, and what is none of them is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.messaging.messages import Box
from server.messaging.packed_arrays import (
    are_boxes,
    check_areas,
    first_boxes,
    histogram_bins,
    last_box,
    pack_boxes,
    pack_histograms,
    unpack_boxes,
    unpack_histograms,
)

SIDE = st.floats(-1e6, 1e6, width=32)
TRACKS = st.lists(st.lists(st.tuples(SIDE, SIDE, SIDE, SIDE) | st.none(), max_size=20), max_size=6)


@given(TRACKS)
def test_boxes_arrive_as_they_were_and_hidden_ones_are_nan(tracks: list[list[Box | None]]) -> None:
    packed = [pack_boxes(boxes) for boxes in tracks]
    expected = [box or (np.nan,) * 4 for boxes in tracks for box in boxes]
    assert np.array_equal(unpack_boxes(packed), np.array(expected).reshape(-1, 4), equal_nan=True)
    assert [last_box(boxes) for boxes in packed] == [boxes[-1] if boxes else None for boxes in tracks]
    assert [first_boxes(boxes, 2) for boxes in packed] == [pack_boxes(boxes[:2]) for boxes in tracks]
    for boxes, track in zip(packed, tracks, strict=True):
        assert are_boxes([boxes], len(track))
        assert not are_boxes([boxes, boxes + bytes(16)], len(track))


def test_coordinates_are_limited_and_boxes_hidden_as_a_whole() -> None:
    packed = pack_boxes([(-1e9, 0.0, 1e9, 4.0), (np.nan, 1.0, 2.0, 3.0)])
    assert last_box(first_boxes(packed, 1)) == (-1e6, 0.0, 1e6, 4.0)
    assert last_box(packed) is None
    assert are_boxes([packed], 2)


@pytest.mark.parametrize("row", [(0, 0, np.inf, 1), (0, 0, 2e6, 1), (0, np.nan, 1, 1)])
def test_other_numbers_are_no_boxes(row: tuple[float, ...]) -> None:
    assert not are_boxes([np.array(row, dtype="<f4").tobytes()], 1)


@pytest.mark.parametrize(
    "packed", [b"x" * 15, pack_boxes([None]), np.array([0, 0, 2e6, 1], dtype="<f4").tobytes()]
)
def test_what_is_covered_has_whole_rectangles(packed: bytes) -> None:
    check_areas(pack_boxes([(0.0, 0.0, 20.0, 10.0), (0.0, 10.0, 5.0, 20.0)]))
    with pytest.raises(ValueError, match="rectangles"):
        check_areas(packed)


@given(st.integers(1, 5), st.integers(1, 96), st.integers(0, 99))
def test_histograms_arrive_as_they_were(count: int, bins: int, seed: int) -> None:
    sent = np.random.default_rng(seed).dirichlet(np.ones(bins), count)
    packed = pack_histograms(sent)
    assert histogram_bins(packed, count) == bins
    arrived = unpack_histograms(packed, count)
    np.testing.assert_allclose(arrived, sent, atol=2e-3)
    np.testing.assert_allclose(arrived.sum(axis=1), 1.0)
    assert histogram_bins(packed[:-1], count) is None
