"""The look-ahead window has the newest boxes and qualities of every frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from bestview import TrackKey
from fakes.service.scripted_cameras import (
    CAMERAS,
    STRIDE,
    TrackNumbers,
    camera_tracks,
    epoch_of,
    small_config,
)
from server.messaging.messages import Box, CameraTracks
from server.messaging.packed_arrays import pack_boxes
from server.service.identity.person_tracker import PersonTracker
from server.service.ingest.epoch_aligner import Epoch
from server.service.view_selection.lookahead_window import LookaheadSettings, LookaheadWindow
from server.service.view_selection.view_quality_buffer import ViewQualityBuffer

WINDOW, EPOCHS = 3 * STRIDE, 5
BOX = st.tuples(*(st.integers(1, 20) for _ in "xywh")).map(
    lambda box: (float(box[0]), float(box[1]), float(box[0] + box[2]), float(box[1] + box[3]))
)
MESSAGE = st.dictionaries(
    st.integers(1, 3), st.lists(BOX | st.none(), min_size=WINDOW, max_size=WINDOW), max_size=3
)
STORY = st.lists(st.dictionaries(st.sampled_from(CAMERAS), MESSAGE, max_size=2), min_size=1, max_size=EPOCHS)


class DriftingPeople(PersonTracker):
    """A person tracker whose numbers change over time, by camera and track."""

    def numbers(self, keys: Sequence[TrackKey], first: int, frames: int) -> NDArray[np.int64]:
        """Return numbers that depend on the frame."""
        return np.array(
            [[self.number_at(key, n) for n in range(first, first + frames)] for key in keys]
        ).reshape(len(keys), frames)

    @staticmethod
    def number_at(key: TrackKey, pulse: int) -> int:
        """Return one track's number in one frame; two tracks may share it; -1: none."""
        return (key.local_id + CAMERAS.index(key.camera) + pulse // 7) % 4 or -1


def window_message(camera: str, epoch: int, boxes: Mapping[int, Sequence[Box | None]]) -> CameraTracks:
    """Return a window of three epochs, the first ones of a recording shorter."""
    message_of_epoch = camera_tracks(camera, epoch, dict.fromkeys(boxes))
    first = max(0, message_of_epoch.last - WINDOW + 1)
    tracks = [
        type(track)(
            id=track.id,
            boxes=pack_boxes(boxes[track.id][: message_of_epoch.last - first + 1]),
            appearance=track.appearance,
            confidence=1.0,
        )
        for track in message_of_epoch.tracks
    ]
    return camera_tracks(camera, epoch, {}, first=first, tracks=tracks)


def expected_qualities(
    story: Sequence[Epoch], quality_buffer: ViewQualityBuffer, people: DriftingPeople
) -> dict[tuple[int, str, int], float]:
    """Return the quality of every view by pulse, camera and number, computed box by box."""
    quality_of_view: dict[tuple[int, str, int], float] = {}
    newest: dict[tuple[int, str], CameraTracks] = {}
    for epoch in story:
        for camera, message in epoch.tracks.items():
            newest |= {(pulse, camera): message for pulse in range(message.first, message.last + 1)}
    for (pulse, camera), message in newest.items():
        [span] = quality_buffer.over(camera, pulse, pulse)
        window = span.window
        for track, key in enumerate(window.window.keys):
            box = message.tracks[track].boxes[pulse - message.first]
            number = people.number_at(key, pulse)
            if box is not None and number > 0 and number in people.known:
                quality_of_view.setdefault(
                    (pulse, camera, number), float(window.quality[pulse - message.first, track])
                )
    return quality_of_view


@settings(deadline=None, max_examples=60)
@given(STORY, st.sets(st.tuples(st.sampled_from(CAMERAS), st.integers(0, 24)), max_size=4), st.booleans())
def test_the_window_has_every_view_once_with_relative_quality(
    story: list[dict[str, dict[int, list[Box | None]]]], missing: set[tuple[str, int]], relative: bool
) -> None:
    config = small_config()
    people = DriftingPeople(config.view.identity, CAMERAS, dict.fromkeys(CAMERAS), (64, 48), lag=0)
    people._registry = TrackNumbers()  # type: ignore[assignment]
    quality_buffer = ViewQualityBuffer(config, dict.fromkeys(CAMERAS), people.letterboxes)
    epochs = [
        epoch_of(
            number, *(window_message(camera, number, boxes) for camera, boxes in boxes_of_camera.items())
        )
        for number, boxes_of_camera in enumerate(story)
    ]
    for epoch in epochs:
        quality_buffer.put(people.update(epoch))
    last = epochs[-1].last
    window = LookaheadWindow(
        CAMERAS,
        quality_buffer,
        people,
        lambda camera, pulse: (camera, pulse) not in missing,
        2,
        last,
        LookaheadSettings(relative=relative),
    )
    views = window.views
    quality_of_view = {
        (int(n) + 2, CAMERAS[c], int(window.numbers[k])): (quality, relative_quality)
        for n, c, k, quality, relative_quality in zip(
            views.frame,
            views.camera,
            views.person,
            window.quality.tolist(),
            views.quality.tolist(),
            strict=True,
        )
    }
    expected = {
        (pulse, camera, number): quality
        for (pulse, camera, number), quality in expected_qualities(epochs, quality_buffer, people).items()
        if pulse >= 2 and (camera, pulse) not in missing and quality > 0
    }
    assert len(quality_of_view) == len(views.frame)
    assert {camera: quality for camera, (quality, _) in quality_of_view.items()} == expected
    for (pulse, camera, number), (quality, relative_quality) in quality_of_view.items():
        best = max(expected.get((pulse, camera, number), 0.0) for camera in CAMERAS) if relative else 1.0
        assert relative_quality == quality / best, camera
    for view, (quality, _) in enumerate(quality_of_view.values()):
        weights = config.view.quality.weights
        terms = dict(zip(config.view.quality.terms, window.terms(view).tolist(), strict=True))
        assert np.prod(
            [1 - weights[term_name] * (1 - term) for term_name, term in terms.items()]
        ) == pytest.approx(quality)
