"""A person's selected view, and the costs behind it, as HTTP returns it."""

from __future__ import annotations

import msgspec

from server.service.decision_state import reason
from server.service.view_selection.queried_reasons import SelectionReason


class ViewSelection(msgspec.Struct, frozen=True):
    """A person's selected view, and the costs behind it."""

    object: int
    first: int
    """First pulse of the newest decided GOP."""
    frames: int
    camera: str | None
    since: int
    """Pulse of the last cut."""
    costs: dict[str, float | None]
    """Mean cost a frame of each camera over the look-ahead; null: cannot be shown."""
    seen: dict[str, float]
    """Share of the look-ahead in which each camera sees the person."""
    quality: dict[str, float | None]
    """Mean view quality of each camera where it sees the person, 0 to 1; null: it does not."""
    terms: dict[str, dict[str, float]]
    """By camera, the mean terms of that quality; empty where it does not see the person."""
    undetected: dict[str, float]
    """Share of the look-ahead in which each camera misses the person, whom others locate in its view."""
    undetected_quality: dict[str, float | None]
    """Mean quality of these inferred views, times the probability of each; null: there are none."""
    weights: dict[str, float]
    """By term: the share of a view's quality that is lost where the term is 0."""
    before: str | None
    """The camera of the GOP before; null: there was none."""
    lookahead_s: float
    """Seconds of the look-ahead, from `first` on."""
    switch_cost_s: float
    """The cost of a cut, in seconds without the person."""
    stay_s: float | None
    """The cost of the look-ahead with `before`; null: there is none, or it cannot be shown."""
    cut_s: float | None
    """The cost with the best other camera, the cut included; null: there is none."""
    cut_to: str | None
    """That camera."""
    reason: str


def view_selection_of(selection: SelectionReason, fps: float) -> ViewSelection:
    """Return a selected view with the costs behind it, at so many frames per second."""
    view, explanation = selection.view, selection.explanation
    return ViewSelection(
        object=view.choice.number,
        first=view.first,
        frames=view.frames,
        camera=view.choice.camera,
        since=view.since,
        costs={camera: camera_view.cost for camera, camera_view in explanation.views.items()},
        seen={camera: camera_view.seen for camera, camera_view in explanation.views.items()},
        quality={camera: camera_view.quality for camera, camera_view in explanation.views.items()},
        terms={camera: camera_view.terms for camera, camera_view in explanation.views.items()},
        undetected={camera: camera_view.undetected for camera, camera_view in explanation.views.items()},
        undetected_quality={
            camera: camera_view.undetected_quality for camera, camera_view in explanation.views.items()
        },
        weights=explanation.weights,
        before=view.choice.before,
        lookahead_s=explanation.frames / fps,
        switch_cost_s=explanation.switch_cost / fps,
        stay_s=None if explanation.stay is None else explanation.stay / fps,
        cut_s=None if explanation.cut is None else explanation.cut / fps,
        cut_to=explanation.cut_to,
        reason=reason(view.choice, explanation),
    )
