"""The window memory: ids when windows are solved again."""

from __future__ import annotations

import numpy as np

from tracking.interactive.settings import InteractiveSettings
from tracking.interactive.window_memory import WindowMemory, WindowSnapshot

PLACE, ELSEWHERE = np.array([10.0, 10.0, 40.0, 90.0]), np.array([200.0, 10.0, 230.0, 90.0])


def _window(end: int) -> WindowSnapshot:
    return WindowSnapshot(first=end - 14, end=end, final_to=end - 10, objects=(), warm_start=None)


def _two_tracks_at_one_place() -> WindowMemory:
    """Start one track in each of two windows, as if the first had ended at once."""
    memory = WindowMemory(InteractiveSettings(memory_s=4.0).resolve(25.0))
    memory.record_window(_window(19))
    assert memory.assign_id(12, PLACE, new_id=1) == 1
    memory.record_window(_window(24))
    assert memory.assign_id(14, PLACE, new_id=2) == 2, (
        "a track that starts at the same place is another object"
    )
    return memory


def test_without_solving_windows_again_no_id_is_reused() -> None:
    memory = _two_tracks_at_one_place()
    memory.record_window(_window(29))
    assert memory.assign_id(15, PLACE, new_id=3) == 3


def test_windows_solved_again_assign_each_of_their_ids_once() -> None:
    memory = _two_tracks_at_one_place()
    memory.record_window(_window(19))
    assert memory.assign_id(13, ELSEWHERE, new_id=3) == 3, "no track started there"
    assert memory.assign_id(13, PLACE, new_id=4) == 1
    assert memory.assign_id(13, PLACE, new_id=4) == 2
    assert memory.assign_id(13, PLACE, new_id=4) == 4


def test_ids_of_windows_that_are_not_solved_again_stay_assigned() -> None:
    memory = _two_tracks_at_one_place()
    memory.record_window(_window(24))
    assert memory.assign_id(13, PLACE, new_id=3) == 2
    assert memory.assign_id(13, PLACE, new_id=3) == 3
