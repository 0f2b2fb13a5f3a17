"""The lossy bus of the fault benchmark, for all kinds of messages."""

from __future__ import annotations

from itertools import pairwise

import pytest

from benchmarks.faults.injection.messages import _correction
from benchmarks.faults.site.lossy_bus import LossyLink, MessageRouter
from client import Box, Gop
from server.messaging.inbox import Message


class RecordingSink:
    """Records published messages."""

    def __init__(self) -> None:
        self.values: dict[str, list[int]] = {}

    def publish(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        del attachment
        self.values.setdefault(key.rpartition("/")[2], []).append(int(payload))


@pytest.mark.parametrize("mode", ["plain", "lost", "doubled", "disordered"])
def test_messages_are_lost_doubled_or_disordered_and_pictures_are_not(mode: str) -> None:
    sink = RecordingSink()
    link = LossyLink(sink)
    link.mode = mode
    for number in range(1000):
        for kind in (*["video"] * 5, "tracks"):
            link.forward(Message(f"myview/faults/camera/c0/{kind}", b"%d" % number, b""))
    tracks, everything = sink.values["tracks"], list(range(1000))
    assert sink.values["video"] == [number for number in everything for _ in range(5)]
    altered = link.altered["tracks"]
    assert link.altered["video"] == 0
    if mode == "plain":
        assert (altered, tracks) == (0, everything)
        return
    assert 250 < altered < 350
    held_back = 1000 - len(tracks) if mode == "disordered" else 0
    assert 0 <= held_back <= 2, "messages still delayed"
    assert len(tracks) == 1000 + {"lost": -altered, "doubled": altered, "disordered": -held_back}[mode]
    later = sum(before > after for before, after in pairwise(tracks))
    assert (later > 100) == (mode == "disordered"), "tracks are reordered, not only pictures"
    assert len(set(tracks)) == 1000 - held_back - (altered if mode == "lost" else 0)


def test_messages_are_routed_to_their_receivers() -> None:
    cameras, bestview = {name: RecordingSink() for name in ("c0", "c1", "c2")}, RecordingSink()
    router = MessageRouter(cameras, bestview)
    for number, kind in enumerate(
        ("video", "tracks", "status", "thumbs/7", "detections", "position_corrections")
    ):
        router.publish(f"myview/faults/camera/c1/{kind}", b"%d" % number)
    assert bestview.values == {"video": [0], "tracks": [1], "status": [2], "7": [3]}
    assert {name: sink.values for name, sink in cameras.items()} == {
        "c0": {"detections": [4]},
        "c1": {"position_corrections": [5]},
        "c2": {"detections": [4]},
    }


def test_an_operator_correction_is_at_the_center_of_the_watched_person() -> None:
    box = Box(1, 10.0, 20.0, 30.0, 60.0)
    gop = Gop(first=30, frames=2, choices={1: "c0", 2: "c0"}, boxes={"c0": ((), (box,))}, cuts=())
    correction = _correction(gop, 1)
    assert correction is not None
    assert correction == {"object": 1, "camera": "c0", "corrections": [{"pulse": 31, "x": 20.0, "y": 40.0}]}
    assert _correction(gop, 2) is None, "no box"
    assert _correction(gop, 3) is None, "no camera"
