"""Times of the whole decision, from track messages to selected views, on simulated crowds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.common.stopwatch import Stopwatch, Watched
from bestview import IdentityUpdate, QualitySettings, TrackletKey, TrackUpdate
from server.config.loader import build_config
from server.config.site_config import Config
from server.messaging.epochs import end_of_epoch
from server.messaging.messages import AppearanceHistogram, CameraTracks, TrackMessage
from server.messaging.packed_arrays import pack_boxes, pack_histograms
from server.service.decision_state import DecisionState
from server.service.identity.camera_window import WindowReader
from server.service.identity.person_tracker import PersonTracker
from server.service.ingest.epoch_aligner import Epoch
from server.service.view_selection import decider as decider_module
from server.service.view_selection.decider import ViewDecider
from server.service.view_selection.lookahead_window import LookaheadPart, LookaheadWindow
from server.service.view_selection.view_quality_buffer import ViewQualityBuffer

_SEED, _WIDTH, _HEIGHT = 5, 1280, 720
_IDS = 1000
"""More than there are people: a person's share of the first bin is a thousandth of their id."""
_WARM = 6
"""Epochs before the measurement, which fill the look-ahead."""
_ALL = QualitySettings(
    size=1.0,
    truncation=0.5,
    occlusion=0.5,
    centering=0.5,
    sharpness=0.5,
    facing=0.5,
    confidence=0.5,
    relative=True,
)


@dataclass(frozen=True, slots=True)
class SimulatedCrowd:
    """Walking people, each visible to `seen_by` of the cameras."""

    people: int
    cameras: int
    seen_by: int

    def epochs(self, config: Config, count: int) -> Iterator[Epoch]:
        """Yield the cameras' messages: a complete window per epoch, as the tracker sends it."""
        rng = np.random.default_rng(_SEED)
        window, stride = config.window.window, config.window.stride
        cameras = [rng.permutation(self.cameras)[: self.seen_by] for _ in range(self.people)]
        height = rng.uniform(40, 120, self.people)
        begin = rng.uniform((0, 200), (_WIDTH, _HEIGHT), (self.people, 2))
        walk = rng.normal(0, 1.5, (self.people, 2))
        for number in range(count):
            last = end_of_epoch(number, stride)
            first = max(0, last - window + 1)
            tracks: dict[str, list[TrackMessage]] = {camera: [] for camera in config.camera_ids}
            for person in range(self.people):
                feet = begin[person] + walk[person] * np.arange(first, last + 1)[:, None]
                tall = height[person]
                boxes = feet[:, [0, 1, 0, 1]] + np.array([-0.2, -1.0, 0.2, 0.0]) * tall
                share = (person + 1) / _IDS
                look = pack_histograms(np.array([share, 1.0 - share]))
                track = TrackMessage(
                    id=person,
                    boxes=pack_boxes(boxes),
                    confidence=0.7,
                    appearance=[AppearanceHistogram(first=first, last=first, histogram=look)],
                )
                for camera in cameras[person]:
                    tracks[config.camera_ids[camera]].append(track)
            yield Epoch(
                number,
                last,
                {camera: _message(camera, number, first, last, tracks[camera]) for camera in tracks},
            )


@dataclass(frozen=True, slots=True)
class StageSeconds:
    """Processor time per frame by stage, seconds."""

    decoding: float
    """Boxes from messages."""
    quality: float
    """View quality from boxes."""
    costs: float
    """Costs arranged by person."""
    selection: float
    """The selection program."""
    bookkeeping: float
    """Everything else of a decision."""
    people: float
    """Identities, with given ids."""
    publishing: float
    """Boxes and choices, encoded as messages."""

    @property
    def decision(self) -> float:
        """The time from messages to selected views."""
        return self.decoding + self.quality + self.costs + self.selection + self.bookkeeping


class _AppearanceRegistry:
    """A registry that decodes people's ids from their appearance."""

    def update(
        self, tracks: Sequence[TrackUpdate], last_frame: int, picture_sizes: Mapping[str, tuple[int, int]]
    ) -> IdentityUpdate:
        """Return the id of every tracklet."""
        del last_frame, picture_sizes
        numbers = {
            TrackletKey(*track.key, 0): round(track.appearance[0].histogram[0] * _IDS) for track in tracks
        }
        return IdentityUpdate(numbers, created=(), returned=(), departed=(), merged=(), split=())


def decision_times(crowd: SimulatedCrowd, gop: int, epochs: int, *, all_terms: bool) -> StageSeconds:
    """Decide for a crowd; return the times of the stages."""
    config = _config(crowd, gop, asdict(_ALL) if all_terms else {})
    ground = np.array([[1.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.002, 1.0]])
    decider = ViewDecider(config, dict.fromkeys(config.camera_ids, ground), lambda _camera, _pulse: True)
    decider.people._registry = _AppearanceRegistry()  # type: ignore[assignment]  # noqa: SLF001 — association is measured elsewhere
    state, watch = DecisionState(25.0), Stopwatch()
    stages: tuple[Watched, ...] = (
        (WindowReader, "read", "decoding"),
        (ViewQualityBuffer, "put", "quality"),
        (LookaheadWindow, "__init__", "costs"),
        (LookaheadWindow, "part", "costs"),
        (LookaheadPart, "gops", "costs"),
        (decider_module, "select_views_by_gop", "selection"),
        (ViewDecider, "step", "bookkeeping"),
        (PersonTracker, "update", "people"),
        (PersonTracker, "boxes", "publishing"),
        (DecisionState, "put", "publishing"),
    )
    for epoch in crowd.epochs(config, _WARM + epochs):
        if epoch.number < _WARM:
            decider.step(epoch)
            continue
        with watch.watching(*stages):
            for decision in decider.step(epoch):
                state.put(decision)
    frames = epochs * config.window.stride
    return StageSeconds(**{stage: spent / frames for stage, spent in watch.seconds.items()})


def _config(crowd: SimulatedCrowd, gop: int, quality: dict[str, float]) -> Config:
    cameras = [{"id": f"c{number}", "source": "scene:room"} for number in range(crowd.cameras)]
    return build_config(
        {
            "site": {"width": _WIDTH, "height": _HEIGHT},
            "encode": {"gop_s": gop / 25.0},
            "cameras": cameras,
            "view": {"quality": quality},
        },
        where="the benchmark",
        folder=Path(),
    )


def _message(camera: str, epoch: int, first: int, last: int, tracks: list[TrackMessage]) -> CameraTracks:
    return CameraTracks(
        camera=camera,
        boot=1,
        size=(_WIDTH, _HEIGHT),
        epoch=epoch,
        first=first,
        last=last,
        final_to=first,
        ended=False,
        shed=[],
        tracks=tracks,
        solve=None,
    )
