"""What a viewer received, held against what the events said of it and what the pictures say of themselves."""

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
    """One viewer's pictures in the time of a fault.

    Attributes:
        frames: how many came.
        wrong: of another camera than the events named, of another moment, or not to be read.
        unnamed: of pulses of which no event was heard, so that any camera may be right.
        repeated: the picture before, shown again because there was none.
        boxes: drawn on these pictures.
        wrong_boxes: found in another frame than the picture shows.
        blurred: means of several boxes, which do not say what they were found in.
        fresh: when each fresh picture came, and which camera it is of.
    """

    frames: int
    wrong: int
    unnamed: int
    repeated: int
    boxes: int
    wrong_boxes: int
    blurred: int
    fresh: tuple[tuple[float, str], ...]
    notes: tuple[str, ...]
    """What was wrong, in words."""
    courses: Mapping[str, LiveFrameOrder]
    """What was shown of each network camera."""

    def without(self, since: float, until: float) -> float:
        """Return the longest time without a fresh picture, seconds, that ends or begins within a span.

        A GOP comes in one piece, so the rhythm of GOPs is in it.
        """
        moments = [at for at, _ in self.fresh]
        before = max((at for at in moments if at <= since), default=since)
        inside = [at for at in moments if since < at <= until]
        return max((b - a for a, b in pairwise([before, *inside, until])), default=0.0)


def judge(
    pictures: Sequence[ReceivedPicture],
    told: EventLog,
    number: int,
    views: StampedViews,
    live: Iterable[str] = (),
) -> PictureVerdict:
    """Judge every picture; of the cameras of ``live`` it is known within bounds only which comes when."""
    said = dict(_said(told, number))
    courses = {camera: LiveFrameOrder() for camera in live}
    fresh, notes = [], []
    wrong = unnamed = repeated = boxes = wrong_boxes = blurred = 0
    before: ReceivedPicture | None = None
    for picture in pictures:
        stamp, last, before = picture.stamp, before, picture
        named = picture.pulse in said
        unnamed += not named
        camera, found = said.get(picture.pulse, (None, ()))
        if last is not None and stamp is not None and stamp == last.stamp:
            repeated += 1
        elif stamp is None or (named and stamp.camera != camera):
            wrong += 1
            notes.append(f"pulse {picture.pulse}: {stamp}, not {camera}")
        elif trouble := _of_another_moment(picture.pulse, stamp, courses):
            wrong += 1
            notes.append(f"pulse {picture.pulse}: {stamp}{trouble}")
        else:
            fresh.append((picture.at, stamp.camera))
        if camera is None or stamp is None:
            continue
        for box in found:
            frame = views.frame_of(camera, box)
            boxes += 1
            blurred += frame is None
            if frame is not None and frame != stamp.frame:
                wrong_boxes += 1
                notes.append(f"pulse {picture.pulse} of {camera}: a box of frame {frame} on {stamp}")
    counts = len(pictures), wrong, unnamed, repeated, boxes, wrong_boxes, blurred
    return PictureVerdict(*counts, tuple(fresh), tuple(notes), courses)


def _of_another_moment(pulse: int, stamp: FrameStamp, courses: Mapping[str, LiveFrameOrder]) -> str:
    """Return in what way a picture is not the one of its pulse; empty: it is."""
    course = courses.get(stamp.camera)
    if course is not None:
        return course.wrong(pulse, stamp.frame)
    return "" if stamp.frame == pulse % FRAMES else ", another frame"


def _said(told: EventLog, number: int) -> Iterator[tuple[int, tuple[str | None, tuple[Box, ...]]]]:
    """Yield for every pulse the camera to be shown and the boxes in its picture.

    Where none is chosen, since nobody sees the person, a stream stays with the last one.
    """
    shown: str | None = None
    for _, gop in told.gops:
        camera = told.choice(gop, number)
        shown = camera or shown
        for place in range(gop.frames):
            yield gop.first + place, (shown, _boxes(gop, camera, place))


def _boxes(gop: Gop, camera: str | None, place: int) -> tuple[Box, ...]:
    frames = gop.boxes.get(camera, ()) if camera is not None else ()
    return frames[place] if place < len(frames) else ()


RHYTHM_S = 10 / FPS
"""A GOP comes in one piece; so long nothing comes in between."""
