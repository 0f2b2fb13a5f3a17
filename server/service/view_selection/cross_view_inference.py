"""Whom cameras do not find though others know where they stand: looks for them, and learns where that is."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bestview import (
    DetectionProbabilityMap,
    boxes_touching_others,
    estimate_bodies,
    project_boxes,
    project_feet,
)
from bestview.quality import CameraLayout, QualitySettings, TrackWindow, compute_view_quality
from server.config.site_config import Config
from server.service.view_selection.undetected_views import TestedViews, UndetectedViews
from server.service.view_selection.view_quality_buffer import ViewQualityBuffer
from server.service.view_selection.window_line import WindowTracks

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_EVERY_S = 0.4
"""How often to look: who is there and not found is so for longer."""
_PRIOR, _FEW_S, _MANY_S = 0.93, 1.5, 4.0
"""The share taken of unknown cameras; seconds of people after which places, and cameras, are known."""
_KEPT_S = 600.0
"""What was learned is forgotten by 1/e in so long: furniture is moved."""
_NO_BOX = 0.4
"""Trust that is left where the camera has nobody's box: not even part of them seems to show."""
_LEAST = 0.25
"""Below this trust there is no view."""


class CrossViewInference:
    """Infers views of people whom a camera does not detect, and learns how often cameras detect people where.

    It goes by what the cameras say alone, and by all people whichever service decides for them, so that all
    services of a site know the same.
    """

    def __init__(self, config: Config, sight: ViewQualityBuffer) -> None:
        self._sight, self._cameras = sight, config.camera_ids
        self._fps = config.site.fps
        self._every = max(1, round(_EVERY_S * self._fps))
        self._size = (float(config.site.width), float(config.site.height))
        few, many = _FEW_S * self._fps, _MANY_S * self._fps
        self._findable = DetectionProbabilityMap(len(self._cameras), self._size, _PRIOR, few, many)

    def look(self, line: WindowTracks, person: Ints, frames: int) -> UndetectedViews:
        """Find the views in the outlook's frames; `person` (L,) says who is at each place in line, or -1."""
        floor = self._floor()
        if len(floor.cameras) < 2:  # noqa: PLR2004 — one that knows, one that does not find
            return UndetectedViews.nobody()
        told = _told(line, person, floor.cameras, len(self._cameras), self._every, frames)
        if not len(told.who):
            return UndetectedViews.nobody()
        known, shape = told.person >= 0, told.found.shape
        moment = told.person[known] * shape[1] + told.time[known]
        bottom = floor.looks.picture_boxes[:, 3]
        body = estimate_bodies(
            told.boxes[known],
            told.camera[known],
            moment,
            shape[0] * shape[1],
            floor.homographies,
            bottom,
        )
        feet = project_feet(body, floor.homographies).reshape(*shape, 2)
        corners = floor.looks.picture_boxes
        inside = ((feet >= corners[:, :2]) & (feet <= corners[:, 2:])).all(axis=-1)
        others = body.known_by.sum(axis=1)[:, None] > body.known_by
        asked = np.nonzero(inside & told.said & others.reshape(shape))
        tested = TestedViews(asked[1] * self._every, floor.cameras[asked[2]], feet[asked], told.found[asked])
        view = np.nonzero(inside & ~told.found)
        trust = self._findable.trust(floor.cameras[view[2]], feet[view])
        good = trust >= _LEAST
        of, time, camera = (side[good] for side in view)
        expected = project_boxes(
            body, of * shape[1] + time, feet[of, time, camera], floor.homographies[camera]
        )
        picture, theirs = time * shape[2] + camera, told.time * shape[2] + told.camera
        touched = boxes_touching_others(
            expected, picture, told.boxes, theirs, shape[1] * shape[2], self._size
        )
        quality = _quality(expected, camera, floor.looks, self._sight.settings)
        quality *= trust[good] * np.where(touched, 1.0, _NO_BOX)
        # Each view stands for the frames up to the next look.
        frame = time * self._every + np.arange(self._every)[:, None]
        there = frame < frames
        each = np.broadcast_to(np.arange(len(time)), frame.shape)[there]
        return UndetectedViews(
            frame[there], floor.cameras[camera[each]], told.who[of[each]], quality[each], tested
        )

    def learn(self, undetected: UndetectedViews, frames: int) -> None:
        """Learn from the first frames of an outlook, which are decided now."""
        tested = undetected.tested
        of = np.flatnonzero(tested.frame < frames)
        if not of.size:  # nothing is forgotten either while nobody is there
            return
        kept = math.exp(-frames / (_KEPT_S * self._fps))
        # The next outlook begins with a look, however soon: each stands for the frames up to then.
        looks = np.minimum(self._every, frames - tested.frame[of]).astype(np.float64)
        self._findable.learn(tested.camera[of], tested.feet[of], tested.found[of], looks, kept)

    def _floor(self) -> _Floor:
        spoken = [at for at, name in enumerate(self._cameras) if name in self._sight.letterboxes]
        looks = self._sight.looks([self._cameras[at] for at in spoken])
        known = [at for at, homography in enumerate(looks.homographies) if homography is not None]
        matrices = [looks.homographies[at] for at in known]
        return _Floor(
            np.array([spoken[at] for at in known], dtype=np.int64),
            replace(looks, picture_boxes=looks.picture_boxes[known], homographies=matrices),
            np.array(matrices, dtype=np.float64).reshape(-1, 3, 3),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Floor:
    """The C cameras that have spoken and whose homography is known.

    Attributes:
        cameras: (C,) by index of all cameras, rising.
        looks: theirs.
        homographies: (C, 3, 3) from the site's picture to the ground.
    """

    cameras: Ints
    looks: CameraLayout
    homographies: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _Told:
    """What C cameras say at S looks: B boxes, of P people whose numbers are known and of others.

    Attributes:
        who: (P,) the people, by index of everybody, rising.
        boxes: (B, 4) pixels of the site's picture.
        person: (B,) place in `who`; -1: nobody's yet.
        time: (B,) at which look.
        camera: (B,) by place among the C.
        said: (S, C) whether the camera would have found them if they showed.
        found: (P, S, C) whether it found them.
    """

    who: Ints
    boxes: Floats
    person: Ints
    time: Ints
    camera: Ints
    said: Mask
    found: Mask


def _told(line: WindowTracks, person: Ints, cameras: Ints, count: int, every: int, frames: int) -> _Told:
    """Read what `cameras`, of `count`, say in every so many of the frames in line."""
    column = np.full(count, -1)
    column[cameras] = np.arange(len(cameras))
    now = (line.frame % every == 0) & (column[line.camera] >= 0)
    said = np.zeros((-(-frames // every), len(cameras)), dtype=np.bool_)
    searched = now & line.searched
    said[line.frame[searched] // every, column[line.camera[searched]]] = True
    places = np.flatnonzero(now[line.row] & (line.quality >= 0.0))
    row, index = line.row[places], person[places]
    who, place = np.unique(index, return_inverse=True)
    nobody = int(np.searchsorted(who, 0))  # how many of them stand for that: one, or none
    who, place = who[nobody:], place - nobody
    time, camera, known = line.frame[row] // every, column[line.camera[row]], place >= 0
    found = np.zeros((len(who), *said.shape), dtype=np.bool_)
    found[place[known], time[known], camera[known]] = True
    return _Told(who, line.boxes(places), place, time, camera, said, found)


def _quality(boxes: Floats, camera: Ints, looks: CameraLayout, settings: QualitySettings) -> Floats:
    """Weigh views by their boxes (V, 4), each by itself, (V,).

    Who hides whom is left out: where two overlap and one is not found, the box may be either's.
    """
    if not any(weight for name, weight in settings.weights.items() if name != "occlusion"):
        return np.ones(len(boxes))
    seen = TrackWindow(boxes[:, None], camera, np.ones(len(boxes)), np.full(len(boxes), np.nan))
    return compute_view_quality(seen, looks, replace(settings, occlusion=0.0)).quality[:, 0]
