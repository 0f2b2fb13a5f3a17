"""What may soon go wrong, for whom, when and why: what an operator is asked about."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Reason = Literal["alike", "exchange", "fading", "gap"]
"""Why: two who look alike are about to cross; two could just as well have exchanged their identities;
somebody fades into the background; the window's answer is not proven to be the best one."""


@dataclass(frozen=True, slots=True)
class Trouble:
    """One thing that may go wrong. Windows that follow each other tell of the same.

    Attributes:
        reason: why.
        objects: the ids of the one or two tracks that it is about; first whom to point at.
        frame: when it is expected. The newest frame or later for what is ahead; within the window for what
            has been seen to be doubtful (`exchange`: where the identities would part): pictures are shown
            later than they are tracked, so that it may still be ahead of who looks at them.
        margin: how sure the tracker is, as a cost: 0 is undecided.
        length: frames for which the two are in each other's way, or somebody is hidden.
        risk: how likely it is to go wrong unless somebody helps, in [0, 1]: what troubles of all reasons are
            compared by.
    """

    reason: Reason
    objects: tuple[int, ...]
    frame: int
    margin: float
    length: int
    risk: float
