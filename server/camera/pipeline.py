"""Processes one camera's frames, live and offline: capture, encoding, detection, tracking.

The same frames give the same tracks.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from bestview import shows_ground
from server.camera.audio import LiveAudioSource
from server.camera.captured_frame import CapturedFrame
from server.camera.detector_setup import make_detector, make_prescanned_detector
from server.camera.encoder import AccessUnit, Encoder
from server.camera.load.skipped_frame_interpolator import SkippedFrameInterpolator
from server.camera.observations import ObservationCollector, RawDetectionCollector, most_confident
from server.camera.operator_corrections import merge_correction
from server.camera.passthrough import PassthroughEncoder, open_passthrough
from server.camera.peers.cross_view_scorer import CrossViewScorer, PeerDetections
from server.camera.sharpness import SharpnessMemory
from server.camera.sources import FrameSource, Image, open_source
from server.camera.sources.live_stream import LiveStream
from server.camera.substream.opening import open_tracked_pictures
from server.camera.track_messages import TrackMessageBuilder
from server.camera.tracker_setup import set_up_tracker
from server.camera.view_monitor import ViewMonitor
from server.config.sections import CameraSettings
from server.config.site_config import Config
from server.media.letterbox import Letterbox
from server.messaging.camera_status import PictureMotion, RetryPause
from server.messaging.messages import CameraTracks, FrameDetections
from server.messaging.operator_messages import CORRECTIONS_MAX
from server.messaging.packed_arrays import pack_boxes
from server.system.errors import UserError
from tracking import Detections
from tracking.detectors import FusedDetector
from tracking.interactive import PositionCorrection

_NO_PEERS = PeerDetections()
_REPORTED_GAP_MAX = 50_000
"""Missed frames of one gap to report, the last ones: after a suspend millions are missing."""


@dataclass(frozen=True, slots=True, eq=False)
class DetectedFrame:
    """A frame after detection.

    Attributes:
        pulse: its pulse.
        image: in which people were detected, at the scale of the tracked pictures; None: there was none.
        detections: empty where detection did not run.
        has_detection: whether detection ran.
        is_located: whether detections are where the homography says: the camera is not turned away.
        message: the detections as sent to the peer cameras; None without peers.
        motion: how the picture has moved since the camera was calibrated, pixels of the site's image.
        skipped: whether load shedding left the frame out.
        waited_s: how long its image was waited for, seconds.
    """

    pulse: int
    image: Image | None
    detections: Detections
    has_detection: bool
    is_located: bool
    message: FrameDetections | None
    motion: PictureMotion | None = None
    skipped: bool = False
    waited_s: float = 0.0

    @property
    def depends_on_peers(self) -> bool:
        """Whether the peers' detections of this frame can change a score."""
        return self.message is not None and len(self.detections) > 0


_AWAY_AFTER_S = 2.0
"""Seconds without frames after which a passthrough camera counts as away."""


class CameraPipeline:
    """Source, encoder, detector and tracker of one camera, without a clock and without a network.

    ``take`` and ``encode`` may run in one thread, ``detect`` and ``track_detections`` in another: they share
    no state.

    ``warm_up``: prepare for the first frame, which takes seconds; otherwise only check that everything opens.
    ``source``: its frames instead of those that the configuration names.

    Raises:
        UserError: the source or the detections cannot be opened, or the homography does not match the image.
    """

    def __init__(
        self,
        config: Config,
        camera_id: str,
        boot: int = 0,
        listener: LiveAudioSource | None = None,
        *,
        warm_up: bool = True,
        source: FrameSource | None = None,
    ) -> None:
        camera, site = config.camera(camera_id), config.site
        passthrough = open_passthrough(config, camera, listener)
        self.is_passthrough = passthrough.source is not None
        """Whether the source's own video is passed through."""
        self.why_encoded = passthrough.reason
        """Why it cannot be passed through; empty: that was not requested."""
        self.source: FrameSource = (
            passthrough.source or source or open_source(camera, site, listener, warm_up=warm_up)
        )
        self._letterbox = Letterbox(self.source.size, (site.width, site.height))
        _check_homography(camera, self.source.size)
        self._encoder = (
            PassthroughEncoder(passthrough.source) if passthrough.source else Encoder(site, config.encode)
        )
        self._passthrough = passthrough.source
        self.tracked = open_tracked_pictures(config, camera, self.source, self._letterbox, passthrough.source)
        """The pictures in which people are detected, at a scale of their own."""
        scale = self.tracked.scale
        detector_config = scale.config(config)
        detector_letterbox = Letterbox(self.source.size, scale.tracked)
        self._detector = (
            make_prescanned_detector(
                detector_config, camera, self.source, detector_letterbox, self.tracked.prescan_images
            )
            if warm_up
            else make_detector(detector_config, camera, detector_letterbox)
        )
        track = config.track
        tracker = set_up_tracker(
            config,
            track.tracker,
            camera,
            self.source,
            lambda: track.create_solver(site.fps),
            self._letterbox,
            prescan=warm_up,
            tracked_images=self.tracked.prescan_images,
        )
        self._tracker = SkippedFrameInterpolator(
            tracker, self._detector.appearance_bins, config.window.stride
        )
        self._messages = TrackMessageBuilder(camera_id, boot, self.source.size, config.window.stride)
        self.view = ViewMonitor(site.fps, self._detector, self.tracked.scale)
        """What the camera shows."""
        self._sharpness = SharpnessMemory() if config.view.quality.sharpness > 0 else None
        self.cross_view = (
            CrossViewScorer(config, camera_id, self.source.size, boot) if config.peers_of(camera_id) else None
        )
        self._observations = (
            ObservationCollector(self._letterbox, config.window.stride)
            if camera_id in config.joint_cameras
            else None
        )
        self._raw_detections = RawDetectionCollector() if config.access.may_blur else None
        self.first_pulse = camera.first_pulse(site.fps) if self.source.recorded else 0
        """The pulse of the first frame."""
        self._last: int | None = None
        self._corrections: deque[PositionCorrection] = deque(maxlen=CORRECTIONS_MAX)
        self._missing = 0
        """Pulses since the last frame."""
        self._away_after = round(_AWAY_AFTER_S * site.fps) + config.gop

    def take(self, pulse: int) -> CapturedFrame | None:
        """Return the frame of a pulse; None where the source has none (yet).

        Raises:
            SourceEndedError: the recording is over.
        """
        image = self.source.take(pulse)
        if image is None and (self._passthrough is None or self._passthrough.current is None):
            self._missing += 1
            return None
        self._missing = 0
        captured = self.source.captured if isinstance(self.source, LiveStream) else None
        site_image = None if image is None else self._letterbox.image(image)
        return CapturedFrame(pulse, site_image, self.tracked.request(captured))

    @property
    def away(self) -> bool:
        """Whether a live camera delivers no frames; passthrough may have to wait for a GOP to begin."""
        return not self.source.recorded and self._missing > (self._away_after if self.is_passthrough else 0)

    @property
    def absence(self) -> RetryPause | None:
        """Why a live camera delivers no frames, and when it is connected again; None: that is not known."""
        return self.source.absence if self.away and isinstance(self.source, LiveStream) else None

    def encode(self, pulse: int, frame: CapturedFrame) -> AccessUnit:
        """Encode the frame of a pulse, which was the last one taken."""
        if isinstance(self._encoder, PassthroughEncoder):
            return self._encoder.encode(pulse, frame.image)
        if frame.image is None:
            raise ValueError("only frames that are passed through have no image")
        return self._encoder.encode(pulse, frame.image)

    def track(self, pulse: int, frame: CapturedFrame | None) -> CameraTracks | None:
        """Detect and track in a frame without the peer cameras."""
        return self.track_detections(self.detect(pulse, frame))

    @property
    def has_network(self) -> bool:
        """Whether a network detects beside the background."""
        return isinstance(self._detector, FusedDetector)

    def detect(
        self, pulse: int, frame: CapturedFrame | None, *, skipped: bool = False, network_factor: int = 1
    ) -> DetectedFrame:
        """Detect people in a frame; it is None if it was not captured or is skipped.

        Waits up to half a second for the substream, if that is later.
        ``skipped``: left out by load shedding; detections are interpolated from the frames around it.
        ``network_factor``: factor of the interval between two runs of the network. Pulses must ascend.
        """
        if isinstance(self._detector, FusedDetector):
            self._detector.run_network_less_often(network_factor)
        image = None if frame is None else self.tracked.image(frame)
        waited_s = 0.0 if frame is None else self.tracked.waited_s
        if image is None:
            detections, has_detection = Detections.empty(self._detector.appearance_bins), False
        else:
            detections = self._detector.detect(image, pulse)
            self.view.observe(image, pulse)
            boxes = self.tracked.scale.boxes_to_site(detections.boxes)
            detections = Detections(boxes, detections.scores, detections.histograms)
            has_detection = not self._detector.warming_up
        shown, motion = self.view.is_located, self.view.motion
        message = (
            self.cross_view.build_message(
                pulse, detections if has_detection and shown else None, motion, self.view.hidden
            )
            if self.cross_view
            else None
        )
        return DetectedFrame(
            pulse, image, detections, has_detection, shown, message, motion, skipped, waited_s
        )

    def track_detections(
        self,
        frame: DetectedFrame,
        peers: PeerDetections = _NO_PEERS,
        corrections: Sequence[PositionCorrection] = (),
    ) -> CameraTracks | None:
        """Update the tracks with a frame's detections; return the track message when a window has ended.

        Corrections wait for the window's end, so that there is one message per epoch.

        A missed pulse, or one without an image, counts as a frame without detections; the message lists these
        frames, except those before a recording begins, and the frames without all peers' detections.
        """
        pulse, detections = frame.pulse, frame.detections
        if self._last is not None:
            missed = range(max(self._last + 1, pulse - _REPORTED_GAP_MAX), pulse)
            self._messages.add_without_image(missed)
            self._messages.add_without_detection(missed)
        self._last = pulse
        if not frame.has_detection:
            self._messages.add_without_detection([pulse])
        if frame.image is None and pulse >= self.first_pulse:
            self._messages.add_without_image([pulse])
        if frame.has_detection:
            self._collect(frame)
        elif frame.skipped and self._observations is not None:
            self._observations.skip(pulse)
        if self.cross_view is not None and frame.depends_on_peers:
            detections = self.cross_view.rescore(detections, peers.messages, frame.motion)
            if peers.is_incomplete:
                self._messages.add_without_peers(pulse)
        result = (
            self._tracker.skip(pulse) if frame.skipped else self._tracker.push(pulse, detections, frame.image)
        )
        self._corrections.extend(corrections)
        if result is None:
            return None
        if self._corrections:
            revised = self._tracker.apply_corrections(list(self._corrections))
            self._corrections.clear()
            result = result if revised is None else merge_correction(result, revised)
        return self._add_picture(self._messages.regular(result), frame.image)

    def end_message(self, end: int) -> FrameDetections | None:
        """Return the message that ends this camera's detections; the recording has no frame ``end``."""
        return None if self.cross_view is None else self.cross_view.build_message(end, None, ended=True)

    def finish(self, end: int) -> CameraTracks:
        """End tracking at the recording's end, which has no frame ``end``: provisional frames become final.

        A camera that was restarted after its recording had ended reports the end again.
        """
        last = end - 1 if self._last is None else self._last
        return self._add_picture(self._messages.closing(self._tracker.flush(), last), None)

    def _collect(self, frame: DetectedFrame) -> None:
        """Keep the detections of a frame for the epoch's message, as far as the site uses them."""
        strongest = most_confident(frame.detections)
        if self._raw_detections is not None:
            self._raw_detections.add(frame.pulse, strongest)
        if self._observations is not None and frame.is_located:
            self._observations.add(frame.pulse, strongest, frame.motion)

    def _add_picture(self, tracks: CameraTracks, image: Image | None) -> CameraTracks:
        """Add the picture's condition and motion, and what the site uses: detections and sharpness."""
        observations = [] if self._observations is None else self._observations.take(tracks.last)
        tracks = msgspec.structs.replace(
            tracks,
            condition=self.view.condition,
            motion=self.view.motion,
            covered=pack_boxes(self.view.hidden),
            observations=observations,
            detections=[] if self._raw_detections is None else self._raw_detections.take(tracks.last),
        )
        return (
            tracks if self._sharpness is None else self._sharpness.measure(tracks, image, self.tracked.scale)
        )

    def close(self) -> None:
        """Close the source and the substream."""
        self.tracked.close()
        self.source.close()


def _check_homography(camera: CameraSettings, size: tuple[int, int]) -> None:
    """Check that the homography maps some of the camera's image, ``size`` = (width, height), to the floor.

    Raises:
        UserError: the whole image lies above the horizon.
    """
    if camera.ground is not None and not shows_ground(np.array(camera.ground, dtype=np.float64), size):
        raise UserError(
            f"camera {camera.id}: ground: its whole image, {size[0]}x{size[1]}, lies above the horizon: "
            "the homography belongs to a camera tilted past straight down, or to another image; leave it out"
        )
