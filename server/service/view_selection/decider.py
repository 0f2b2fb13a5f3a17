"""Selects views: one decision per GOP for all people at once (paper, section III)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from bestview import NO_CAMERA, Merge, Split, select_views_by_gop
from server.config.sections import LIVE_VIEW_SETTINGS, ViewSettings
from server.config.site_config import Config
from server.messaging.messages import NumberedBox
from server.service.identity.occupied_regions import OccupiedRegions, Regions
from server.service.identity.person_tracker import PersonTracker
from server.service.identity.sharding import create_sharding
from server.service.ingest.epoch_aligner import Epoch
from server.service.view_selection.current_shots import CurrentShots
from server.service.view_selection.explanation import GopExplanation
from server.service.view_selection.lookahead_window import LookaheadSettings, LookaheadWindow
from server.service.view_selection.mode_selection import ModeSelection
from server.service.view_selection.recent_views import RecentViews
from server.service.view_selection.undetected_view_inference import UndetectedViewInference
from server.service.view_selection.view_quality_buffer import ViewQualityBuffer
from tracking.types import PictureCondition

Floats = NDArray[np.float64]

_TAIL_DIVISOR = 5
"""The last fifth of the look-ahead represents its end: a single frame would be too uncertain."""


@dataclass(frozen=True, slots=True)
class ObjectChoice:
    """The view of one object in one GOP."""

    number: int
    camera: str | None
    """None: no camera can be shown."""
    before: str | None
    """The camera of the GOP before."""
    departed: bool
    """Whether no camera has seen the person for a while; the stream stays with the last camera."""


@dataclass(frozen=True, slots=True, eq=False)
class PictureState:
    """One camera's pictures at the end of a GOP.

    Attributes:
        condition: what is wrong with them.
        ground: (3, 3) homography from the site's image to the ground; None: there is none.
    """

    condition: PictureCondition
    ground: Floats | None


@dataclass(frozen=True, slots=True)
class GopDecision:
    """All people's views for the frames ``first … first + frames - 1``."""

    first: int
    frames: int
    choices: tuple[ObjectChoice, ...]
    boxes: dict[str, list[list[NumberedBox]]]
    """Per camera and frame: all people's final boxes, by rising number."""
    merged: dict[int, int]
    """All merged numbers so far, with the numbers that were kept."""
    corrections: tuple[Merge | Split, ...]
    """Merges and splits since the last decision."""
    reasons: GopExplanation = field(compare=False, repr=False)
    """The costs behind the choices."""
    pictures: Mapping[str, PictureState] = field(default_factory=dict, compare=False, repr=False)
    """By camera, of those that have sent the last frame."""
    occupied: Mapping[str, Regions] = field(default_factory=dict, compare=False, repr=False)
    """By camera: the regions with people, where viewers may see them pixelated."""


def camera_homographies(config: Config) -> dict[str, Floats | None]:
    """Return every camera's homography from its image to the ground; None if there is none."""
    return {
        camera.id: None if camera.ground is None else np.array(camera.ground, dtype=np.float64)
        for camera in config.cameras
    }


class ViewDecider:
    """Selects views GOP by GOP as epochs arrive. No clock, no network: the same epochs lead to the same cuts.

    Every decision evaluates the whole look-ahead again, without cameras that have failed since.
    ``has(camera, pulse)`` returns whether a camera's frame can be shown.
    """

    def __init__(
        self,
        config: Config,
        camera_homographies: Mapping[str, Floats | None],
        has: Callable[[str, int], bool],
    ) -> None:
        self._config = config
        self.modes = ModeSelection(config)
        """The views of viewers who choose another delay."""
        self._apply(config.view)
        self._cameras: Sequence[str] = config.camera_ids
        self._has = has
        size = (config.site.width, config.site.height)
        fps = config.site.fps
        self.people = PersonTracker(
            config.view.identity,
            self._cameras,
            camera_homographies,
            size,
            config.track.final_lag(fps),
            create_sharding(config, camera_homographies),
            config.overhead,
            fps,
            config.joint_cameras,
            config.person_numbers,
        )
        stride, gop = config.window.stride, config.gop
        self._occupied = (
            OccupiedRegions(self.people, self._cameras, fps, stride) if config.access.may_blur else None
        )
        self._max_gops_per_epoch = -(-stride // gop) + 1
        """One more than an epoch completes, so that a backlog after a shorter look-ahead shrinks."""
        self._quality_buffer = ViewQualityBuffer(config, camera_homographies, self.people.letterboxes)
        self._undetected_view_inference = UndetectedViewInference(config, self._quality_buffer)
        self._shots = CurrentShots()
        self._recent_views = RecentViews()
        self._next_gop: int | None = None

    @property
    def view(self) -> ViewSettings:
        """The settings in force."""
        return self._config.view

    def apply_live_view_settings(self, view: ViewSettings) -> None:
        """Apply other settings from the next GOP on; only those in `LIVE_VIEW_SETTINGS`.

        With a longer look-ahead, decisions wait for it; with a shorter one, the GOPs that are then complete
        are decided gradually, so that viewers are not flooded. Every GOP is decided once, in order.

        Afterwards decisions cannot be reproduced from the recordings and the configuration alone.
        """
        live = {name: getattr(view, name) for name in LIVE_VIEW_SETTINGS}
        settings = self._config.view.model_copy(update=live)
        quality_changed = settings.quality != self._config.view.quality
        self._config = self._config.model_copy(update={"view": settings})
        self._apply(settings)
        if quality_changed:
            self._quality_buffer.change_settings(settings.quality)

    def _apply(self, view: ViewSettings) -> None:
        fps = self._config.site.fps
        self.switch_cost = view.switch_cost_s * fps
        self.min_shot_gops = -(-round(view.min_shot_s * fps) // self._config.gop)
        """The minimum length of a shot, in GOPs."""
        self._extrapolated_frames = view.extrapolate_s * fps
        self.modes.change(view)

    def step(self, epoch: Epoch) -> list[GopDecision]:
        """Process an epoch; return decisions for the GOPs whose look-ahead it completes.

        After skipped epochs, the GOPs that were not decided before them are skipped, too.
        """
        gop, lookahead = self._config.gop, self._config.lookahead
        if self._next_gop is None or epoch.skipped:  # earlier frames are unknown
            start = epoch.last - self._config.window.stride + 1
            self._next_gop = -(-start // gop) * gop
        self._quality_buffer.put(self.people.update(epoch))
        if self._occupied is not None:
            self._occupied.take(epoch)
        window_of_epoch = cache(partial(self._window, self._next_gop, epoch.last))
        if self._next_gop <= epoch.last:
            self.modes.step(epoch.last, window_of_epoch, skipped=bool(epoch.skipped))
        last = epoch.last - lookahead + 1
        if self._next_gop > last:
            return []
        window = window_of_epoch()
        weight = self._weight(lookahead)
        gop_starts = range(self._next_gop, last + 1, gop)[: self._max_gops_per_epoch]
        decided = [self._decide(window, first, gop, weight) for first in gop_starts]
        self._recent_views = window.recent_views(self._next_gop)
        self._undetected_view_inference.learn(window.inferred_views, self._next_gop - window.first)
        return decided

    def finish(self, last: int) -> list[GopDecision]:
        """Decide the remaining GOPs when all recordings are over; ``last`` is the last frame of all."""
        if self._next_gop is None or self._next_gop > last:
            return []
        gop, lookahead = self._config.gop, self._config.lookahead
        window = self._window(self._next_gop, last)
        decided = [
            self._decide(window, first, min(gop, last + 1 - first), np.ones(min(lookahead, last + 1 - first)))
            for first in range(self._next_gop, last + 1, gop)
        ]
        self.modes.finish()
        return decided

    def _window(self, first: int, last: int) -> LookaheadWindow:
        """Return the look-ahead window of the frames from `first` to `last`, as known now."""
        view = self._config.view
        return LookaheadWindow(
            self._cameras,
            self._quality_buffer,
            self.people,
            self._has,
            first,
            last,
            LookaheadSettings(
                relative=view.quality.relative,
                decay_frames=view.presence_decay_s * self._config.site.fps,
                undetected_weight=view.undetected_weight,
            ),
            self._recent_views,
            self._undetected_view_inference,
        )

    def _weight(self, lookahead: int) -> Floats:
        """Return the weight of each frame of the look-ahead: the last ones also stand for what follows."""
        weight, last = np.ones(lookahead), max(1, lookahead // _TAIL_DIVISOR)
        weight[-last:] += self._extrapolated_frames / last
        return weight

    def _decide(self, window: LookaheadWindow, first: int, frames: int, weight: Floats) -> GopDecision:
        people, lookahead = self.people, len(weight)
        part = window.part(first, lookahead, window.seen_since(first + frames - 1))
        before = self._shots.of(part.numbers)
        starts = np.arange(lookahead) % self._config.gop == 0
        gops = part.gops(starts, weight, mark_hidden=self.min_shot_gops > 1)
        (views,), _ = select_views_by_gop(
            gops, before.cameras, self.switch_cost, self.min_shot_gops, before.gops, decided_gops=1
        )
        self._shots = before.then(views)
        self._next_gop = first + self._config.gop
        self.modes.add(part, frames, gops, weight, views, before.cameras)
        boxes = {camera: people.boxes(camera, first, frames) for camera in self._cameras}
        occupied = (
            {}
            if self._occupied is None
            else {camera: self._occupied.next(camera, first, frames) for camera in self._cameras}
        )
        self._quality_buffer.forget_before(self._next_gop)
        people.forget_before(self._next_gop)
        names = [*self._cameras, None]  # NO_CAMERA, -1, indexes the last one
        assert NO_CAMERA == -1  # noqa: S101 — the line above relies on it
        choices = tuple(
            ObjectChoice(number, names[view], names[last], number in people.registry.departed)
            for number, view, last in zip(
                part.numbers.tolist(), views.tolist(), before.cameras.tolist(), strict=True
            )
        )
        reasons = GopExplanation(part, before.cameras, weight, self.switch_cost, self._config.view.quality)
        return GopDecision(
            first,
            frames,
            choices,
            boxes,
            dict(people.registry.merged),
            people.take_corrections(),
            reasons,
            self._pictures(first + frames - 1),
            occupied,
        )

    def ground(self, camera: str) -> Floats | None:
        """Return the homography from the site's image to the ground, where the camera looks now, or None."""
        return self._quality_buffer.ground(camera)

    def _pictures(self, pulse: int) -> dict[str, PictureState]:
        buffer = self._quality_buffer
        return {
            camera: PictureState(buffer.conditions[camera], buffer.ground(camera))
            for camera in self._cameras
            if self._has(camera, pulse)
        }
