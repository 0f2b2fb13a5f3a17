"""What the faults' benchmark does to messages, and that all kinds of them meet it."""

from __future__ import annotations

from itertools import pairwise

import pytest

from benchmarks.faults.injection.messages import _pointing
from benchmarks.faults.site.lossy_bus import LossyLink, MessageRouter
from client import Box, Gop
from server.messaging.inbox import Message


class Heard:
    """Notes what is published."""

    def __init__(self) -> None:
        self.of: dict[str, list[int]] = {}

    def publish(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        del attachment
        self.of.setdefault(key.rpartition("/")[2], []).append(int(payload))


@pytest.mark.parametrize("how", ["plain", "lost", "doubled", "disordered"])
def test_messages_are_lost_doubled_or_disordered_and_pictures_are_not(how: str) -> None:
    heard = Heard()
    way = LossyLink(heard)
    way.how = how
    for number in range(1000):
        for what in (*["video"] * 5, "tracks"):
            way.take(Message(f"myview/faults/camera/c0/{what}", b"%d" % number, b""))
    tracks, everything = heard.of["tracks"], list(range(1000))
    assert heard.of["video"] == [number for number in everything for _ in range(5)]
    faulty = way.faulty["tracks"]
    assert way.faulty["video"] == 0
    if how == "plain":
        assert (faulty, tracks) == (0, everything)
        return
    assert 250 < faulty < 350
    held_back = 1000 - len(tracks) if how == "disordered" else 0
    assert 0 <= held_back <= 2, "those that would still come"
    assert len(tracks) == 1000 + {"lost": -faulty, "doubled": faulty, "disordered": -held_back}[how]
    later = sum(before > after for before, after in pairwise(tracks))
    assert (later > 100) == (how == "disordered"), "others of their kind go by, not only pictures"
    assert len(set(tracks)) == 1000 - held_back - (faulty if how == "lost" else 0)


def test_messages_go_to_whom_they_are_for() -> None:
    cameras, bestview = {name: Heard() for name in ("c0", "c1", "c2")}, Heard()
    crossing = MessageRouter(cameras, bestview)
    for number, what in enumerate(
        ("video", "tracks", "status", "thumbs/7", "detections", "position_corrections")
    ):
        crossing.publish(f"myview/faults/camera/c1/{what}", b"%d" % number)
    assert bestview.of == {"video": [0], "tracks": [1], "status": [2], "7": [3]}
    assert {name: heard.of for name, heard in cameras.items()} == {
        "c0": {"detections": [4]},
        "c1": {"position_corrections": [5]},
        "c2": {"detections": [4]},
    }


def test_an_operator_points_at_the_middle_of_whom_they_watch() -> None:
    box = Box(1, 10.0, 20.0, 30.0, 60.0)
    gop = Gop(first=30, frames=2, choices={1: "c0", 2: "c0"}, boxes={"c0": ((), (box,))}, cuts=())
    said = _pointing(gop, 1)
    assert said is not None
    assert said == {"object": 1, "camera": "c0", "points": [{"pulse": 31, "x": 20.0, "y": 40.0}]}
    assert _pointing(gop, 2) is None, "they are in no box"
    assert _pointing(gop, 3) is None, "they are shown by no camera"
