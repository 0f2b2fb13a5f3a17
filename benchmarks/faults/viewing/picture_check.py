"""Check of a viewer's pictures against the events and the stamps in the pictures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from benchmarks.faults.video.stamped_views import FPS, FRAMES, FrameStamp, StampedViews
from benchmarks.faults.viewing.live_pictures import LiveFrameOrder
from benchmarks.faults.viewing.viewers import EventLog, ReceivedPicture
from client import Box, Gop


@dataclass(frozen=True, slots=True)
class PictureVerdict:
    """The check of one viewer's pictures during a fault.

    Attributes:
        frames: received pictures.
        wrong: pictures of a camera or frame other than the expected one, or illegible.
        unnamed: pictures of pulses without an event, whose camera is unchecked.
        repeated: pictures equal to the previous one.
        boxes: drawn on these pictures.
        wrong_boxes: detected in another frame than the picture's.
        averaged: interpolated boxes, which carry no frame number.
        fresh: the time of arrival and the camera of each fresh picture.
    """

    frames: int
    wrong: int
    unnamed: int
    repeated: int
    boxes: int
    wrong_boxes: int
    averaged: int
    fresh: tuple[tuple[float, str], ...]
    notes: tuple[str, ...]
    """Descriptions of errors."""
    live_orders: Mapping[str, LiveFrameOrder]
    """The pictures of each network camera."""

    def longest_gap(self, since: float, until: float) -> float:
        """Return the longest time without a fresh picture, seconds, that ends or begins within a span.

        It includes the length of a GOP, which arrives in one piece.
        """
        moments = [at for at, _ in self.fresh]
        before = max((at for at in moments if at <= since), default=since)
        inside = [at for at in moments if since < at <= until]
        return max((b - a for a, b in pairwise([before, *inside, until])), default=0.0)


def check_pictures(
    pictures: Sequence[ReceivedPicture],
    events: EventLog,
    number: int,
    views: StampedViews,
    live: Iterable[str] = (),
) -> PictureVerdict:
    """Check every picture; the frames of ``live`` cameras are known only within bounds."""
    expected = dict(_expected_pictures(events, number))
    live_orders = {camera: LiveFrameOrder() for camera in live}
    fresh, notes = [], []
    wrong = unnamed = repeated = boxes = wrong_boxes = averaged = 0
    before: ReceivedPicture | None = None
    for picture in pictures:
        stamp, last, before = picture.stamp, before, picture
        named = picture.pulse in expected
        unnamed += not named
        camera, found = expected.get(picture.pulse, (None, ()))
        if last is not None and stamp is not None and stamp == last.stamp:
            repeated += 1
        elif stamp is None or (named and stamp.camera != camera):
            wrong += 1
            notes.append(f"pulse {picture.pulse}: {stamp}, not {camera}")
        elif error := _moment_error(picture.pulse, stamp, live_orders):
            wrong += 1
            notes.append(f"pulse {picture.pulse}: {stamp}{error}")
        else:
            fresh.append((picture.at, stamp.camera))
        if camera is None or stamp is None:
            continue
        for box in found:
            frame = views.frame_of(camera, box)
            boxes += 1
            averaged += frame is None
            if frame is not None and frame != stamp.frame:
                wrong_boxes += 1
                notes.append(f"pulse {picture.pulse} of {camera}: a box of frame {frame} on {stamp}")
    counts = len(pictures), wrong, unnamed, repeated, boxes, wrong_boxes, averaged
    return PictureVerdict(*counts, tuple(fresh), tuple(notes), live_orders)


def _moment_error(pulse: int, stamp: FrameStamp, live_orders: Mapping[str, LiveFrameOrder]) -> str:
    """Return how a picture differs from that of its pulse; empty if it is correct."""
    order = live_orders.get(stamp.camera)
    if order is not None:
        return order.check(pulse, stamp.frame)
    return "" if stamp.frame == pulse % FRAMES else ", another frame"


def _expected_pictures(
    events: EventLog, number: int
) -> Iterator[tuple[int, tuple[str | None, tuple[Box, ...]]]]:
    """Yield for every pulse the selected camera and the boxes in its picture.

    If no camera shows the person, the stream stays with the last one.
    """
    shown: str | None = None
    for _, gop in events.gops:
        camera = events.choice(gop, number)
        shown = camera or shown
        for place in range(gop.frames):
            yield gop.first + place, (shown, _boxes(gop, camera, place))


def _boxes(gop: Gop, camera: str | None, place: int) -> tuple[Box, ...]:
    frames = gop.boxes.get(camera, ()) if camera is not None else ()
    return frames[place] if place < len(frames) else ()


GOP_S = 10 / FPS
"""Seconds of a GOP, which arrives in one piece."""
