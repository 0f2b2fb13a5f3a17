"""The delay of every frame, split by stage; the stages add up to the total.

A GOP is decided and sent at once, when the tracks of its whole look-ahead have arrived: its first frame is
then due to be shown, and its k-th frame k frames later. Both waits, for the frames ahead and for the GOP's
earlier frames, belong to the look-ahead; their sum is the same for every frame.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.latency.bus_subscriber import BusTimestamps, DecisionRecord
from benchmarks.latency.shown_frames import ShownFrames

STAGES = {
    "captured": "from when the pulse is due to the picture",
    "encoded": "the picture to H.264",
    "received": "over the bus, by a subscriber of the best view's router",
    "look-ahead": "until the last frame of the look-ahead is due",
    "solved": "until every camera in time has detected, tracked and solved up to it",
    "decided": "until the decision arrives on the bus; includes waiting for late cameras",
    "shown": "HTTP, the player's buffer, decoding, the screen",
}


@dataclass(frozen=True, slots=True)
class StageDelays:
    """Delays by stage of every shown frame whose timestamps are known, seconds."""

    pulses: NDArray[np.int64]
    """``(frames,)``, ascending."""
    stages: NDArray[np.float64]
    """``(frames, stages)`` in the order of :data:`STAGES`."""
    shown_share: float
    """Frames shown, of all between the first and the last shown."""
    unknown: int
    """Shown frames that are left out, because a timestamp is missing."""
    gops: int
    """Decisions on shown frames."""
    late: int
    """Of these: made before every camera had solved its window."""

    @property
    def totals(self) -> NDArray[np.float64]:
        """Seconds from due to shown, ``(frames,)``."""
        total: NDArray[np.float64] = self.stages.sum(axis=1)
        return total


def split(marks: BusTimestamps, shown: ShownFrames) -> StageDelays:
    """Split the delay of every shown frame by stage.

    Raises:
        ValueError: no shown frame has all timestamps.
    """
    rows = sorted(_rows(marks, shown))
    if not rows:
        raise ValueError("no shown frame has all timestamps")
    first, last = min(shown.at), max(shown.at)
    decisions = [decision for decision in marks.decisions if first <= decision.first <= last]
    return StageDelays(
        pulses=np.array([pulse for pulse, _ in rows]),
        stages=np.array([stages for _, stages in rows]),
        shown_share=len(shown.at) / (last - first + 1),
        unknown=len(shown.at) - len(rows),
        gops=len(decisions),
        late=sum(_solved(marks, decision, shown.lookahead).late for decision in decisions),
    )


def _rows(marks: BusTimestamps, shown: ShownFrames) -> Iterator[tuple[int, list[float]]]:
    for decision in marks.decisions:
        camera = decision.choices.get(shown.object)
        if camera is None:
            continue
        solved = _solved(marks, decision, shown.lookahead)
        for pulse in range(decision.first, decision.first + decision.frames):
            frame, at = marks.frames.get((camera, pulse)), shown.at.get(pulse)
            if frame is None or at is None:
                continue
            turn = (pulse - decision.first) / shown.fps
            ahead = frame.due + (solved.last - pulse) / shown.fps
            ready = ahead if solved.at is None else solved.at
            times = [frame.due, frame.captured_at, frame.encoded, frame.received]
            times += [moment + turn for moment in (ahead, ready, decision.received)]
            yield pulse, [float(step) for step in np.diff([*times, at])]


@dataclass(frozen=True, slots=True)
class _SolvedWindows:
    last: int
    """The window's last pulse."""
    at: float | None
    """When the last camera in time had solved it; None: no camera was in time."""
    late: bool
    """Whether some camera was late."""


def _solved(marks: BusTimestamps, decision: DecisionRecord, lookahead: int) -> _SolvedWindows:
    """Return the first window that reaches the end of a decision's look-ahead.

    Cameras that had not solved it when the decision arrived were left out of the decision.
    """
    needed = decision.first + lookahead - 1
    last = min((last for last in marks.solved if last >= needed), default=needed)
    times = marks.solved.get(last, {}).values()
    in_time = [at for at in times if at <= decision.received]
    return _SolvedWindows(last, max(in_time, default=None), len(in_time) < len(times))
