"""The states of a target, and the transitions between them (Todor 2009, section 8.2, figure 16).

The smaller of two targets that come close changes its state, the larger one stays `OK`. If their sizes
differ, the sizes will tell them apart after an occlusion; otherwise the target is flagged for the operator.
Areas are those of connected components. The thesis's state `SWITCH` is not needed: the components of two
targets that part are assigned to both at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class FlagState(StrEnum):
    """The state of one target."""

    OK = "ok"
    FAIL_COLOR = "fail color"  # no component: it resembles the background
    CLOSE_FLAGGED = "close, flagged"
    CLOSE_UNFLAGGED = "close"
    OCCLUDED_FLAGGED = "occluded, flagged"
    OCCLUDED_UNFLAGGED = "occluded"

    @property
    def is_flagged(self) -> bool:
        """Whether the operator is asked to look at the target."""
        return self in {FlagState.FAIL_COLOR, FlagState.CLOSE_FLAGGED, FlagState.OCCLUDED_FLAGGED}

    @property
    def is_occluded(self) -> bool:
        """Whether the target shares the component of another one."""
        return self in {FlagState.OCCLUDED_FLAGGED, FlagState.OCCLUDED_UNFLAGGED}

    @property
    def is_close(self) -> bool:
        """Whether another target is near."""
        return self in {FlagState.CLOSE_FLAGGED, FlagState.CLOSE_UNFLAGGED}


@dataclass(frozen=True, slots=True)
class ComponentView:
    """What a frame shows of a target.

    Attributes:
        area: of its component; `None` without one.
        neighbor_area: of the nearest other target's component, if that touches the margin; else `None`.
        merged: whether the components of the two have become one.
        split: whether their common component has become two.
    """

    area: float | None
    neighbor_area: float | None = None
    merged: bool = False
    split: bool = False


def next_state(state: FlagState, view: ComponentView, max_size_ratio: float) -> FlagState:
    """Return the next state.

    `max_size_ratio`: share of the larger area from which two targets count as equally large.
    """
    if state.is_occluded:
        close = FlagState.CLOSE_FLAGGED if state.is_flagged else FlagState.CLOSE_UNFLAGGED
        return close if view.split else state
    if state.is_close:
        occluded = FlagState.OCCLUDED_FLAGGED if state.is_flagged else FlagState.OCCLUDED_UNFLAGGED
        apart = FlagState.OK if view.neighbor_area is None else state
        return occluded if view.merged else apart
    if view.area is None:
        return FlagState.FAIL_COLOR
    if state is FlagState.FAIL_COLOR or view.neighbor_area is None or view.area >= view.neighbor_area:
        return FlagState.OK
    similar = view.area >= max_size_ratio * view.neighbor_area
    return FlagState.CLOSE_FLAGGED if similar else FlagState.CLOSE_UNFLAGGED
