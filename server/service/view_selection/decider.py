"""Which camera shows whom: one decision per GOP for all objects at once (paper, section III)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestview import NO_CAMERA, Merge, Split, select_views_by_gop
from server.config.sections import LIVE_VIEW_SETTINGS, ViewSettings
from server.config.site_config import Config
from server.messaging.messages import NumberedBox
from server.service.identity.people import PersonTracker
from server.service.ingest.epoch_aligner import Epoch
from server.service.view_selection.cross_view_inference import CrossViewInference
from server.service.view_selection.current_shots import CurrentShots
from server.service.view_selection.explanation import SelectionReasons
from server.service.view_selection.lookahead_window import LookaheadWindow
from server.service.view_selection.recent_views import RecentViews
from server.service.view_selection.view_quality_buffer import ViewQualityBuffer

Floats = NDArray[np.float64]

_LAST = 5
"""How the look-ahead ends is read from its last fifth: a single frame would be too uncertain."""


@dataclass(frozen=True, slots=True)
class ObjectChoice:
    """The view of one object in one GOP."""

    number: int
    camera: str | None
    """None: no camera can be shown."""
    before: str | None
    """The camera of the GOP before."""
    away: bool
    """No camera has seen the object for a while; its stream stays where it was."""


@dataclass(frozen=True, slots=True)
class GopDecision:
    """All objects' views for the frames ``first … first + frames - 1``."""

    first: int
    frames: int
    choices: tuple[ObjectChoice, ...]
    boxes: dict[str, list[list[NumberedBox]]]
    """Per camera and frame: everybody's final box, by rising number."""
    merged: dict[int, int]
    """Numbers that turned out to be another's, up to now."""
    corrections: tuple[Merge | Split, ...]
    """What has turned out about numbers since the last decision."""
    why: SelectionReasons = field(compare=False, repr=False)
    """What the choices were made by."""


def camera_homographies(config: Config) -> dict[str, Floats | None]:
    """Return every camera's homography from its own picture to the ground, None where there is none."""
    return {
        camera.id: None if camera.ground is None else np.array(camera.ground, dtype=np.float64)
        for camera in config.cameras
    }


class ViewDecider:
    """Selects views GOP by GOP as epochs come. No clock, no network: the same epochs give the same cuts.

    Every decision looks at the whole look-ahead anew: a camera that has died meanwhile is no longer in it.
    ``has(camera, pulse)`` tells whether a camera's frame can be shown.
    """

    def __init__(
        self,
        config: Config,
        camera_homographies: Mapping[str, Floats | None],
        has: Callable[[str, int], bool],
    ) -> None:
        self._config = config
        self._take(config.view)
        self._cameras: Sequence[str] = config.camera_ids
        self._has = has
        size = (config.site.width, config.site.height)
        fps, share = config.site.fps, config.view.share
        self.people = PersonTracker(
            config.view.identity,
            self._cameras,
            camera_homographies,
            size,
            config.track.lag(fps),
            share,
            config.overhead,
            fps,
        )
        stride, gop = config.track.window.stride, config.encode.gop
        self._at_once = -(-stride // gop) + 1
        """GOPs that an epoch decides at most: one more than it completes while the look-ahead stays."""
        self._sight = ViewQualityBuffer(config, camera_homographies, self.people.letterboxes)
        self._elsewhere = CrossViewInference(config, self._sight)
        self._shots = CurrentShots()
        self._lately = RecentViews()
        self._next_gop: int | None = None

    @property
    def view(self) -> ViewSettings:
        """What the choices are made by now."""
        return self._config.view

    def apply_view_settings(self, view: ViewSettings) -> None:
        """Apply other settings from the next GOP on, as far as `LIVE_VIEW_SETTINGS` names them.

        A longer look-ahead is waited for first; with a shorter one there is more to decide, which is done
        little by little: who watches is not to be overrun. Either way every GOP is decided once, in order.

        What is decided then cannot be had again from the recordings and the configuration alone.
        """
        kept = self._config.view.model_copy(update={name: getattr(view, name) for name in LIVE_VIEW_SETTINGS})
        anew = kept.quality != self._config.view.quality
        self._config = self._config.model_copy(update={"view": kept})
        self._take(kept)
        if anew:
            self._sight.weigh_anew(kept.quality)

    def _take(self, view: ViewSettings) -> None:
        fps = self._config.site.fps
        self.switch_cost = view.switch_cost_s * fps
        self.least_shot = -(-round(view.min_shot_s * fps) // self._config.encode.gop)
        """GOPs that a shot lasts at least."""
        self._extrapolated_frames = view.extrapolate_s * fps

    def step(self, epoch: Epoch) -> list[GopDecision]:
        """Take an epoch in; give the GOPs whose look-ahead it completes.

        Where epochs before it are left out, so are the GOPs that were not decided by then.
        """
        gop, lookahead = self._config.encode.gop, self._config.view.lookahead
        if self._next_gop is None or epoch.skipped:  # nobody can say any more what was before
            start = epoch.last - self._config.track.window.stride + 1
            self._next_gop = -(-start // gop) * gop
        self._sight.put(self.people.update(epoch))
        last = epoch.last - lookahead + 1
        if self._next_gop > last:
            return []
        outlook = self._outlook(self._next_gop, epoch.last)
        weight = self._weight(lookahead)
        firsts = range(self._next_gop, last + 1, gop)[: self._at_once]
        decided = [self._decide(outlook, first, gop, weight) for first in firsts]
        self._lately = outlook.lately(self._next_gop)
        self._elsewhere.learn(outlook.looked, self._next_gop - outlook.first)
        return decided

    def finish(self, last: int) -> list[GopDecision]:
        """Decide what is left when every recording is over; ``last`` is the last frame of the longest."""
        if self._next_gop is None or self._next_gop > last:
            return []
        gop, lookahead = self._config.encode.gop, self._config.view.lookahead
        outlook = self._outlook(self._next_gop, last)
        return [
            self._decide(
                outlook, first, min(gop, last + 1 - first), np.ones(min(lookahead, last + 1 - first))
            )
            for first in range(self._next_gop, last + 1, gop)
        ]

    def _outlook(self, first: int, last: int) -> LookaheadWindow:
        """Look at the frames from `first` to `last` with what is known of people by now."""
        return LookaheadWindow(
            self._cameras,
            self._sight,
            self.people,
            self._has,
            first,
            last,
            relative=self._config.view.quality.relative,
            lately=self._lately,
            lasts=self._config.view.presence_decay_s * self._config.site.fps,
            elsewhere=self._elsewhere if self._config.view.undetected_weight else None,
            undetected_weight=self._config.view.undetected_weight,
        )

    def _weight(self, lookahead: int) -> Floats:
        """Return how many frames each frame of the look-ahead stands for: the last one counts for longer."""
        weight, last = np.ones(lookahead), max(1, lookahead // _LAST)
        weight[-last:] += self._extrapolated_frames / last
        return weight

    def _decide(self, outlook: LookaheadWindow, first: int, frames: int, weight: Floats) -> GopDecision:
        people, lookahead = self.people, len(weight)
        everybody, seen = outlook.numbers, people.registry.first_seen
        known = np.fromiter((seen[it] for it in everybody.tolist()), np.int64, len(everybody))
        part = outlook.part(first, lookahead, known < first + frames)
        before = self._shots.of(part.numbers)
        starts = np.arange(lookahead) % self._config.encode.gop == 0
        gops = part.gops(starts, weight, blind=self.least_shot > 1)
        (views,), _ = select_views_by_gop(
            gops, before.cameras, self.switch_cost, self.least_shot, before.held, decided_gops=1
        )
        self._shots = before.then(views)
        self._next_gop = first + self._config.encode.gop
        boxes = {camera: people.boxes(camera, first, frames) for camera in self._cameras}
        self._sight.forget_before(self._next_gop)
        people.forget_boxes_before(self._next_gop)
        names = [*self._cameras, None]  # NO_CAMERA is the last of them
        assert NO_CAMERA == -1  # noqa: S101 — as the line above says
        choices = tuple(
            ObjectChoice(number, names[view], names[last], number in people.registry.away)
            for number, view, last in zip(
                part.numbers.tolist(), views.tolist(), before.cameras.tolist(), strict=True
            )
        )
        why = SelectionReasons(part, before.cameras, weight, self.switch_cost, self._config.view.quality)
        return GopDecision(
            first, frames, choices, boxes, dict(people.registry.merged), people.take_corrections(), why
        )
