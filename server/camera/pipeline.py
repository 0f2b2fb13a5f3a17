"""What one camera does with a frame, live and offline alike: the same frames give the same tracks."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from server.camera.audio import LiveAudioSource
from server.camera.background_warmup import warm_up_detector
from server.camera.corrected_windows import corrected_messages
from server.camera.detector_setup import make_detector
from server.camera.encoding.encoder import AccessUnit, Encoder
from server.camera.floor_check import check_floor
from server.camera.load.frame_skipper import FrameSkipper
from server.camera.passthrough import PassthroughEncoder, open_passthrough
from server.camera.peers.cross_view_scorer import CrossViewScorer, PeerDetections
from server.camera.sharpness import SharpnessMemory
from server.camera.sources import Image, PictureSource, open_source
from server.camera.track_messages import TrackMessageBuilder
from server.camera.tracker_setup import set_up_tracker
from server.config.site_config import Config
from server.media.letterbox import Letterbox
from server.messaging.messages import CameraTracks, FrameDetections
from server.messaging.operator_messages import OPERATOR_POINTS_MAX
from tracking import Detections, create_solver
from tracking.interactive import PositionCorrection

_BY_ITSELF = PeerDetections()
_TOLD_MOST = 50_000
"""Frames of one hole that are told of, the last ones: a machine that slept has missed millions."""


@dataclass(frozen=True, slots=True, eq=False)
class DetectedFrame:
    """A frame after detection.

    Attributes:
        pulse: its pulse.
        image: the picture; None: there was none to search.
        detections: what was found.
        looked: whether it could be searched; otherwise it says nothing that nobody was found.
        word: that, for the other cameras; None where nobody goes by it.
        left_out: it was left out on purpose.
    """

    pulse: int
    image: Image | None
    detections: Detections
    looked: bool
    word: FrameDetections | None
    left_out: bool = False

    @property
    def asks(self) -> bool:
        """Whether what others found in this frame can change anything."""
        return self.word is not None and len(self.detections) > 0


_WAITS_S = 2.0
"""How long nothing may come of a camera that passes through before it counts as away."""


class CameraPipeline:
    """Source, encoder, detector and tracker of one camera, without a clock and without a network.

    ``take`` and ``encode`` may run in one thread, ``search`` and ``follow`` in another: they share nothing.

    ``ready``: for the first frame, which takes seconds; else it is only looked whether all can be opened.

    Raises:
        UserError: the source or the detections cannot be opened, or the homography is of no such picture.
    """

    def __init__(
        self,
        config: Config,
        camera_id: str,
        boot: int = 0,
        listener: LiveAudioSource | None = None,
        *,
        ready: bool = True,
    ) -> None:
        camera, site = config.camera(camera_id), config.site
        own = open_passthrough(config, camera, listener)
        self.passes = own.source is not None
        """The source's own H.264 is passed on."""
        self.why_encoded = own.why
        """Why it is not, where it could have been; empty: nobody wished it."""
        self.source: PictureSource = own.source or open_source(camera, site, listener, ready=ready)
        self._fit = Letterbox(self.source.size, (site.width, site.height))
        check_floor(camera, self.source.size)
        self._encoder = PassthroughEncoder(own.source) if own.source else Encoder(site, config.encode)
        self._detector = (
            warm_up_detector(config, camera, self.source, self._fit)
            if ready
            else make_detector(config, camera, self._fit)
        )
        track = config.track
        tracker = set_up_tracker(
            config,
            track.tracker,
            camera,
            self.source,
            lambda: create_solver(track.solver),
            self._fit,
            ready=ready,
        )
        self._tracker = FrameSkipper(tracker, self._detector.bins, track.window.stride)
        self._reporter = TrackMessageBuilder(camera_id, boot, self.source.size, track.window.stride)
        self._sharpness = SharpnessMemory() if config.view.quality.sharpness > 0 else None
        self.witness = (
            CrossViewScorer(config, camera_id, self.source.size, boot)
            if config.witnesses(camera_id)
            else None
        )
        self.begins = camera.offset if self.source.recorded else 0
        """The pulse at which the pictures begin."""
        self._last: int | None = None
        self._pointings: deque[PositionCorrection] = deque(maxlen=OPERATOR_POINTS_MAX)
        self._without = 0
        """Pulses since the last picture."""
        self._patience = round(_WAITS_S * site.fps) + config.encode.gop

    def take(self, pulse: int) -> Image | None:
        """Return the site-sized picture of a pulse, None where the source has none yet.

        Raises:
            SourceEndedError: the recording is over.
        """
        own = self.source.take(pulse)
        if own is None:
            self._without += 1
            return None
        self._without = 0
        return self._fit.image(own)

    @property
    def away(self) -> bool:
        """Whether a camera gives no pictures; one that passes through may only wait for a GOP to begin."""
        return not self.source.recorded and self._without > (self._patience if self.passes else 0)

    def encode(self, pulse: int, image: Image) -> AccessUnit:
        """Encode the picture of a pulse, the last one that was taken."""
        return self._encoder.encode(pulse, image)

    def track(self, pulse: int, image: Image | None) -> CameraTracks | None:
        """Search a frame and follow everybody into it by what this camera sees itself."""
        return self.follow(self.search(pulse, image))

    def search(self, pulse: int, image: Image | None, *, left_out: bool = False) -> DetectedFrame:
        """Look for people in a frame, which has no image where it was not taken, or has to be left out.

        ``left_out``: on purpose, so that the frames around it tell who was there. Pulses must grow.
        """
        if image is None:
            detections, looked = Detections.empty(self._detector.bins), False
        else:
            detections = self._detector.detect(image, pulse)
            looked = not self._detector.warming_up
        word = self.witness.word(pulse, detections if looked else None) if self.witness else None
        return DetectedFrame(pulse, image, detections, looked, word, left_out=left_out)

    def follow(
        self,
        searched: DetectedFrame,
        heard: PeerDetections = _BY_ITSELF,
        pointings: Sequence[PositionCorrection] = (),
    ) -> CameraTracks | None:
        """Follow everybody into a frame; give the tracks when a window has ended.

        Where somebody points waits for that, and mends the past with it: there is one message of each epoch.

        A pulse that does not come, or has no image, is a frame in which nobody was seen; the camera's report
        says which those were, but for the time before a recording begins. It also says in which frames
        some other camera's word was not there.
        """
        pulse, detections = searched.pulse, searched.detections
        if self._last is not None:
            missed = range(max(self._last + 1, pulse - _TOLD_MOST), pulse)
            self._reporter.shed(missed)
            self._reporter.unsearched(missed)
        self._last = pulse
        if not searched.looked:
            self._reporter.unsearched([pulse])
        if searched.image is None and pulse >= self.begins:
            self._reporter.shed([pulse])
        if self.witness is not None and searched.asks:
            detections = self.witness.scored(detections, heard.words)
            if heard.alone:
                self._reporter.alone(pulse)
        result = (
            self._tracker.leave_out(pulse)
            if searched.left_out
            else self._tracker.push(pulse, detections, searched.image)
        )
        self._pointings.extend(pointings)
        if result is None:
            return None
        if self._pointings:
            anew = self._tracker.point(list(self._pointings))
            self._pointings.clear()
            result = result if anew is None else corrected_messages(result, anew)
        return self._measured(self._reporter.regular(result), searched.image)

    def last_word(self, end: int) -> FrameDetections | None:
        """Return what the other cameras are told when the recording has no frame ``end``."""
        return None if self.witness is None else self.witness.word(end, None, ended=True)

    def finish(self, end: int) -> CameraTracks:
        """Close the recording, which has no frame ``end``: what is provisional becomes final.

        A camera that was started again after its recording was over says so, too.
        """
        last = end - 1 if self._last is None else self._last
        return self._measured(self._reporter.closing(self._tracker.flush(), last), None)

    def _measured(self, tracks: CameraTracks, image: Image | None) -> CameraTracks:
        """Return how sharp everybody is, where that counts."""
        return tracks if self._sharpness is None else self._sharpness.measured(tracks, image)

    def close(self) -> None:
        """Let go of the source."""
        self.source.close()
