"""Identity switches are found by comparing a revised window with the published one."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview import TrackKey
from fakes.service.scripted_cameras import HEIGHT, WIDTH, camera_tracks
from server.media.letterbox import Letterbox
from server.service.identity.camera_window import CameraWindow
from server.service.identity.id_switch_repair import IdSwitch, find_id_switches
from server.service.ingest.window_history import HistorySpan

FRAMES, FIRST = 20, 100
PLACE = np.array([0.0, 0.0, 10.0, 30.0])


def window(boxes: NDArray[np.float64], first: int) -> CameraWindow:
    """Return a camera's window of the boxes (T, F, 4)."""
    tracks = range(1, len(boxes) + 1)
    last = first + boxes.shape[1] - 1
    message = camera_tracks("c0", 0, dict.fromkeys(tracks, (1.0, 1.0, 2.0, 2.0)), first=first, last=last)
    keys = tuple(TrackKey("c0", track) for track in tracks)
    letterbox = Letterbox((WIDTH, HEIGHT), (WIDTH, HEIGHT))
    return CameraWindow(message, keys, np.array(list(tracks)), letterbox, boxes, first)


def paths(tracks: int) -> NDArray[np.float64]:
    """Return boxes of people who walk in separate lanes, (T, FRAMES, 4)."""
    step, lane = np.arange(FRAMES)[None, :, None], np.arange(tracks)[:, None, None]
    return PLACE + step * np.array([1.0, 0.0, 1.0, 0.0]) + lane * np.array([0.0, 40.0, 0.0, 40.0])


@given(
    st.integers(2, 6),
    st.permutations(range(6)),
    st.integers(0, FRAMES - 4),
    st.integers(0, 3),
    st.integers(0, FRAMES - 6),
)
def test_two_tracks_that_swap_positions_have_switched_identities(
    tracks: int, order: list[int], since: int, newer: int, forgotten: int
) -> None:
    one, two = sorted([number for number in order if number < tracks][:2])
    old, revised = paths(tracks), paths(tracks)
    revised[[one, two], since:] = revised[[two, one], since:]
    # The newest frames were not published yet, and the oldest may be forgotten.
    known = FRAMES - 1 - newer
    published = HistorySpan(window(old, FIRST), FIRST + forgotten, FIRST + known)
    found = find_id_switches(window(revised, FIRST), [published])
    overlap = known + 1 - max(since, forgotten)
    if overlap < 2:
        assert found == []
        return
    frame = FIRST + (since if since > forgotten else 0)
    assert found == [IdSwitch(TrackKey("c0", one + 1), TrackKey("c0", two + 1), frame)]


def test_unchanged_hidden_and_cyclic_tracks_have_not_switched() -> None:
    old = paths(3)
    assert find_id_switches(window(old, FIRST), [HistorySpan(window(old, FIRST), FIRST, FIRST + 9)]) == []
    assert find_id_switches(window(old, FIRST), []) == []
    cycle = old.copy()
    cycle[:, 5:] = cycle[[1, 2, 0], 5:]
    assert find_id_switches(window(cycle, FIRST), [HistorySpan(window(old, FIRST), FIRST, FIRST + 9)]) == []
    hidden = old.copy()
    hidden[0, 5:] = hidden[1, 5:]
    hidden[1, 5:] = np.nan
    assert find_id_switches(window(hidden, FIRST), [HistorySpan(window(old, FIRST), FIRST, FIRST + 9)]) == []


def test_in_a_crowd_a_track_switches_with_one_other_only() -> None:
    old = paths(3)
    old[2] = old[1] + 2.0
    revised = old.copy()
    revised[[0, 1], 5:] = revised[[1, 0], 5:]
    found = find_id_switches(window(revised, FIRST), [HistorySpan(window(old, FIRST), FIRST, FIRST + 12)])
    assert found == [IdSwitch(TrackKey("c0", 1), TrackKey("c0", 2), FIRST + 5)]
