"""Online tracking of everybody on a ground plane by all cameras at once, at any frame rate.

People do not move far from one picture to the next, and detectors err in it as they did before: the program
has one frame for all those within `frame_s` (a keyframe), and what is between two of them follows.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from tracking.frame_rate import DEFAULT_FPS, frames_in
from tracking.ground_plane.between_keyframes import Keyframe, frames_after, frames_until
from tracking.ground_plane.camera import GroundCamera
from tracking.ground_plane.keyframe_tracker import KeyframeTracker
from tracking.ground_plane.settings import GroundSettings
from tracking.ground_plane.tracks import GroundFrame
from tracking.solvers.base import PartsSolver
from tracking.types import Detections


class GroundPlaneTracker:
    """Tracks the people on a plane that several cameras see. Deterministic; memory bounded by the window.

    Keyframes are the last of each `interval` frames. Of each camera they have the detections of the last of
    these frames that it has searched.
    """

    def __init__(
        self,
        cameras: Mapping[str, GroundCamera],
        settings: GroundSettings,
        solver: PartsSolver,
        fps: float = DEFAULT_FPS,
        units_per_meter: float | None = None,
    ) -> None:
        """Create a tracker of frames that are 1 / `fps` seconds apart.

        `units_per_meter`: of the plane; None: estimated from the heights of the first boxes.
        """
        self._names = tuple(cameras)
        self._interval = frames_in(settings.frame_s, fps)
        self._most_skipped = settings.forget_after_s * fps
        self._keyframes = KeyframeTracker(cameras, settings, solver, fps / self._interval, units_per_meter)
        self._searched: dict[int, Mapping[str, Detections]] = {}
        """By frame, from the last final keyframe on."""
        self._open: dict[int, dict[str, int]] = {}
        """By keyframe that is not final, the frame that each camera has searched."""
        self._previous: Keyframe | None = None
        self._first_open: int | None = None
        self._last: int | None = None

    def push(self, frame: int, detections: Mapping[str, Detections]) -> list[GroundFrame]:
        """Add the detections of a frame by camera; return the frames that become final, in order.

        Cameras that are left out have not searched the frame, as none has in a skipped one; after a gap
        longer than `forget_after_s` everybody is new.

        Raises:
            ValueError: the frame number is not larger than the last one, or a camera is not known.
        """
        unknown = sorted(set(detections) - set(self._names))
        if unknown:
            raise ValueError(f"no camera is called {unknown[0]!r}; there are {', '.join(self._names)}")
        if self._last is not None and frame <= self._last:
            raise ValueError(f"frame {frame} came after frame {self._last}")
        final = []
        if self._last is not None and frame - self._last > self._most_skipped:
            final = self.flush()
        if self._first_open is None:
            self._first_open = frame
        begun = frame if self._last is None else self._last + 1
        self._last = frame
        self._searched[frame] = detections
        for number in range(begun // self._interval, (frame + 1) // self._interval):
            final += self._push_keyframe(number)
        return final

    def set_camera(self, name: str, camera: GroundCamera) -> None:
        """Replace a camera's calibration from the next frame on.

        Raises:
            KeyError: no camera has this name.
        """
        self._keyframes.set_camera(name, camera)

    @property
    def person_height(self) -> float | None:
        """How tall people are, in the unit of the plane; None before the first detections."""
        return self._keyframes.person_height

    @property
    def offsets(self) -> dict[str, float]:
        """By camera, meters by which it disagrees with the others about where people stand."""
        return self._keyframes.offsets

    @property
    def first_open(self) -> int | None:
        """The first frame that is not final; None: all are."""
        return self._first_open

    def provisional(self) -> list[GroundFrame]:
        """Return the frames that are not final yet, as the last solution has them.

        Since that solution people stay where they were. Who has arrived since the last final frame has no
        number yet, and is left out.
        """
        previous, found = self._previous, list[GroundFrame]()
        for people in self._keyframes.provisional():
            keyframe = self._keyframe(people)
            found += frames_until(keyframe, previous, self._next(previous), self._searched)
            previous = keyframe
        if previous is not None and self._last is not None:
            found += frames_after(previous, self._last, self._searched)
        return found

    def flush(self) -> list[GroundFrame]:
        """End the recording: return the remaining frames; everybody is forgotten."""
        final = []
        if self._last is not None and (self._last + 1) % self._interval:
            final = self._push_keyframe(self._last // self._interval)
        final += self._finish(self._keyframes.flush())
        self._searched, self._open = {}, {}
        self._previous = self._first_open = self._last = None
        return final

    def _push_keyframe(self, number: int) -> list[GroundFrame]:
        """Add the keyframe of the frames from `number` times the interval on; return what becomes final."""
        found: dict[str, Detections] = {}
        searched: dict[str, int] = {}
        for frame in range(number * self._interval, (number + 1) * self._interval):
            for camera, detections in self._searched.get(frame, {}).items():
                found[camera], searched[camera] = detections, frame
        self._open[number] = searched
        return self._finish(self._keyframes.push(number, found))

    def _finish(self, keyframes: Iterable[GroundFrame]) -> list[GroundFrame]:
        """Return all frames up to the last of these keyframes, which are final."""
        final: list[GroundFrame] = []
        for people in keyframes:
            keyframe = self._keyframe(people)
            final += frames_until(keyframe, self._previous, self._next(self._previous), self._searched)
            self._previous, self._first_open = keyframe, keyframe.frame + 1
            del self._open[people.frame]
        if self._previous is not None:
            for frame in [frame for frame in self._searched if frame <= self._previous.frame]:
                del self._searched[frame]
        return final

    def _keyframe(self, people: GroundFrame) -> Keyframe:
        last = (people.frame + 1) * self._interval - 1
        if self._last is not None:
            last = min(last, self._last)
        return Keyframe(last, people, self._open[people.frame])

    def _next(self, previous: Keyframe | None) -> int:
        """Return the frame after a keyframe, or the first one that is not final."""
        return previous.frame + 1 if previous is not None else self._first_open or 0


def track_ground_plane(
    tracker: GroundPlaneTracker, frames: Iterable[tuple[int, Mapping[str, Detections]]]
) -> list[GroundFrame]:
    """Return the final frames of a whole recording."""
    final = [found for number, detections in frames for found in tracker.push(number, detections)]
    return final + tracker.flush()
