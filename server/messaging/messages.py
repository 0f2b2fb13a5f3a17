"""The messages on the bus, and the keys they travel under.

Video is plain Annex B H.264 (or VP8 frames). Choices are JSON, like the events of the HTTP API. All else,
which MyView's processes tell each other, is MessagePack with named fields, as is the header in zenoh's
attachment; boxes and histograms are packed (`packed_arrays`).

===============================================  ===================================  =======================
key                                              payload                              attachment
===============================================  ===================================  =======================
``myview/SITE/camera/ID/video``                  one access unit, Annex B or VP8      :class:`FrameHeader`
``myview/SITE/camera/ID/tracks``                 :class:`CameraTracks`
``myview/SITE/camera/ID/status``                 :class:`~server.messaging.camera_status.CameraStatus`
``myview/SITE/camera/ID/unavailable``            ``UnavailableCamera``, while its source cannot be used
``myview/SITE/camera/ID/thumbs/LOCAL``           JPEG of one person                   :class:`ThumbnailHeader`
``myview/SITE/camera/ID/detections``             :class:`FrameDetections`
``myview/SITE/camera/ID/position_corrections``   ``PositionCorrections``, to the camera
``myview/SITE/camera/ID/identities``             ``CameraIdentitySnapshot``, to the camera
``myview/SITE/camera/ID/retained_identities``    the same, to a service that starts; empty: none
``myview/SITE/camera/ID/peer_listener``          liveliness token: receives the other cameras' detections
``myview/SITE/camera/ID/alive``                  liveliness token
``myview/SITE/sound``                            consecutive frames of audio          :class:`AudioHeader`
``myview/SITE/bestview/choices``                 :class:`GopChoices`
``myview/SITE/bestview/INDEX/choices``           of a further service, and so on
``myview/SITE/bestview/record``                  ``ServiceRecord``, to the other services
``myview/SITE/bestview/people``                  ``SitePeople``, to other sites
``myview/SITE/bestview/state``                   a query: ``ServiceState``, to a service that starts
``myview/SITE/bestview/alive``                   liveliness token
``myview/SITE/bestview/INDEX/alive``             of a further service
===============================================  ===================================  =======================
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import msgspec

from server.messaging.camera_status import PictureMotion
from server.messaging.number_types import PULSE_MAX, Coordinate, Cost, Duration, Number, Pixels, Pulse, Time
from server.messaging.observations import FrameObservations
from server.messaging.operator_messages import RISK_EVENTS_MAX, RiskEvent
from server.messaging.packed_arrays import (
    PackedAreas,
    PackedBoxes,
    PackedDetections,
    PackedHistogram,
    check_areas,
    check_detections,
)
from tracking.types import PictureCondition

DECODE_ERRORS = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)
"""The exceptions of a decoder: an invalid message, invalid UTF-8, nested too deeply."""

Box = tuple[Coordinate, Coordinate, Coordinate, Coordinate]
"""Left, top, right, bottom in pixels of the site's image."""

NumberedBox = tuple[int, float, float, float, float]
"""A person's number, and their box: left, top, right, bottom in pixels of the site's image."""


class FrameHeader(msgspec.Struct, frozen=True, kw_only=True):
    """Header of one access unit. Times are unix seconds by the camera's clock."""

    pulse: Pulse
    key: bool
    """Whether it begins a GOP: it contains SPS, PPS and an IDR picture."""
    boot: Number
    """Identifies the run of the camera's process."""
    reference_pulse: Pulse | None = None
    """The pulse of the access unit that it references; null: unknown. A keyframe's has no meaning."""
    due: Time
    """When the pulse was due."""
    captured_at: Time
    """When the frame was captured."""
    encoded: Time


class AppearanceHistogram(msgspec.Struct, frozen=True, kw_only=True):
    """Appearance of a person: mean color histogram of consecutive frames with no one else in the box."""

    first: Pulse
    last: Pulse
    histogram: PackedHistogram
    """The mean of these frames' histograms; its shares sum to 1."""


AUDIO_FRAMES_MAX = 16_384
"""Audio frames in one message, at most: some minutes."""


class AudioHeader(msgspec.Struct, frozen=True, kw_only=True):
    """Header of consecutive audio frames (:mod:`server.media.audio.audio_format`)."""

    first: Number
    """The number of the first frame, counted from pulse 0; a frame has 1024 samples of AAC, 960 of Opus."""
    sizes: Annotated[
        list[Annotated[int, msgspec.Meta(ge=1, le=8184)]], msgspec.Meta(max_length=AUDIO_FRAMES_MAX)
    ]
    """Bytes of each; ADTS allows 8191 with its header."""


class TrackMessage(msgspec.Struct, frozen=True, kw_only=True):
    """One person in one camera over a window."""

    id: Number
    """The tracker's own number: one per person, camera and boot."""
    boxes: PackedBoxes
    """One per frame of the window, in pixels of the site's image; NaN where the person is hidden."""
    confidence: Cost
    appearance: list[AppearanceHistogram] = []
    """In frames up to ``final_to`` without other people in the box, in order."""
    sharpness: Annotated[float, msgspec.Meta(ge=0, le=1)] | None = None
    """Sharpness of the person's image; null: not measured."""


class SolverReport(msgspec.Struct, frozen=True, kw_only=True):
    """Objective, bound and gap of a window's solution."""

    objective: Cost
    bound: Cost
    gap: Cost
    integral: bool
    rounds: Number
    limit: Literal["work", "time"] | None = None
    """The limit of the solver's budget that ended the search; null: none."""


TRACKS_MAX = 1000
"""Tracks of one window, at most: more than people fit into any image."""


class RawDetections(msgspec.Struct, frozen=True, kw_only=True):
    """Whom a camera's detector has found in a frame, whether a track follows them or not."""

    pulse: Pulse
    boxes: PackedDetections
    """In pixels of the site's image."""

    def __post_init__(self) -> None:
        """Check the boxes.

        Raises:
            ValueError: these are no detections; decoders then raise a `ValidationError`.
        """
        check_detections(self.boxes)


class CameraTracks(msgspec.Struct, frozen=True, kw_only=True):
    """Tracks of one camera after solving one window."""

    camera: str
    boot: Number
    size: tuple[Pixels, Pixels]
    """Width and height of the camera's image; boxes are in pixels of the site's."""
    epoch: Pulse
    """Number of the window: it ends with pulse (epoch + 1) · stride - 1, or with the recording."""
    first: Pulse
    """First frame (pulse number) of the window."""
    last: Annotated[int, msgspec.Meta(ge=-1, le=PULSE_MAX)]
    """Last frame; -1 or before ``first`` where there was none."""
    final_to: Annotated[int, msgspec.Meta(ge=-PULSE_MAX, le=PULSE_MAX)]
    """Frames up to this one are final, unless a later message revises them (``revised_from``)."""
    ended: bool
    """Whether the recording has ended: this is its last message."""
    shed: list[Pulse]
    """Frames of this epoch that were missed, or skipped by detection because the machine was too busy."""
    without_detection: list[Pulse] = []
    """Frames of this epoch without detection: shed ones, and those before the recording begins or while the
    detector learns its background."""
    without_peers: list[Pulse] = []
    """Frames tracked without another camera's detections, which had not arrived."""
    tracks: Annotated[list[TrackMessage], msgspec.Meta(max_length=TRACKS_MAX)]
    solve: SolverReport | None
    solved_at: Time = 0.0
    """When the window was solved, unix seconds by the camera's clock; 0 offline."""
    detection_s: Duration | None = None
    """Mean seconds of detection per frame in this epoch; null offline."""
    solve_s: Duration | None = None
    """Seconds of tracking at the end of the window; null offline."""
    condition: PictureCondition = "clear"
    """What is wrong with the picture at the end of the window."""
    motion: PictureMotion | None = None
    """How it has moved by then; null: not noticeably. Moved back, boxes match the homography."""
    covered: PackedAreas = b""
    """The part of the site's picture in which people are hidden by then: the lens is covered, leaves move."""
    risk_events: Annotated[list[RiskEvent], msgspec.Meta(max_length=RISK_EVENTS_MAX)] = []
    """Predicted tracking failures, where `track.assist` is on."""
    revised_from: Pulse | None = None
    """The first final frame that an operator's correction has changed; null: none."""
    observations: list[FrameObservations] = []
    """The searched frames of this epoch, where cameras of a common ground are tracked jointly."""
    detections: list[RawDetections] = []
    """The searched frames of this epoch, where viewers may see people pixelated."""

    def __post_init__(self) -> None:
        """Check the covered part.

        Raises:
            ValueError: it has no rectangles; decoders then raise a `ValidationError`.
        """
        check_areas(self.covered)


class FrameDetections(msgspec.Struct, frozen=True, kw_only=True):
    """Detections of a camera in one frame, before tracking, for the other cameras."""

    camera: str
    boot: Number
    size: tuple[Pixels, Pixels]
    """Width and height of the camera's image."""
    pulse: Pulse
    boxes: PackedDetections | None
    """Null: detection did not run."""
    covered: PackedAreas = b""
    """The part of the camera's image in which people are hidden, as in `CameraTracks`."""
    ended: bool = False
    """Whether the recording has ended before this pulse: this is its last message."""

    def __post_init__(self) -> None:
        """Check the boxes.

        Raises:
            ValueError: they are none; decoders then raise a `ValidationError`.
        """
        check_detections(self.boxes or b"")
        check_areas(self.covered)


class ThumbnailHeader(msgspec.Struct, frozen=True, kw_only=True):
    """The track and frame of a thumbnail."""

    track: Number
    boot: Number
    pulse: Pulse


class ViewCut(msgspec.Struct, frozen=True, kw_only=True):
    """A change of view."""

    object: int
    pulse: int
    from_camera: str = msgspec.field(name="from")
    to_camera: str = msgspec.field(name="to")


class PersonMerge(msgspec.Struct, frozen=True, kw_only=True):
    """Two numbers are one person: ``lost`` is never used again."""

    kept: int
    lost: int


class PersonSplit(msgspec.Struct, frozen=True, kw_only=True):
    """A camera's track of ``kept`` is another person, ``new_object``."""

    kept: int
    new_object: int
    camera: str


class GopChoices(msgspec.Struct, frozen=True, kw_only=True):
    """The chosen camera of every object for one GOP, and the final boxes of its frames."""

    first: int
    frames: int
    choices: dict[int, str]
    boxes: dict[str, list[list[NumberedBox]]]
    """Per camera and frame: object, left, top, right, bottom."""
    cuts: list[ViewCut]
    merged: list[PersonMerge] = []
    """Merges and, in ``split``, splits since the GOP before."""
    split: list[PersonSplit] = []


class EndReceived(msgspec.Struct, frozen=True, kw_only=True):
    """A best-view service's confirmation that it has received the end of a camera's recording."""

    service: str
    """The key of the service's liveliness token."""
    boot: Number
    """The camera's run whose end it was."""


_CAMERA_PART = 3


@dataclass(frozen=True, slots=True)
class ZenohKeys:
    """The zenoh key expressions of a site."""

    site: str

    def camera(self, camera_id: str, topic: str) -> str:
        """Return a camera's key; ``*`` as the id stands for all cameras."""
        return f"myview/{self.site}/camera/{camera_id}/{topic}"

    @property
    def sound(self) -> str:
        """The key of the site's audio."""
        return f"myview/{self.site}/sound"

    @property
    def everything(self) -> str:
        """All keys of the site."""
        return f"myview/{self.site}/**"

    def bestview(self, topic: str, index: int = 0) -> str:
        """Return a key of the best-view service with this index."""
        return f"myview/{self.site}/bestview/{f'{index}/' if index else ''}{topic}"


def camera_of_key(key: str) -> str:
    """Return the camera id inside a camera's key; empty where there is none."""
    parts = key.split("/")
    return parts[_CAMERA_PART] if len(parts) > _CAMERA_PART else ""
