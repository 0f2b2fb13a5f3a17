"""What one camera does with a frame, live and offline alike: the same frames give the same tracks."""

from __future__ import annotations

from server.camera.encode import AccessUnit, Encoder
from server.camera.observe import make_detector
from server.camera.own import Passing, open_own
from server.camera.report import Reporter
from server.camera.sharpness import Sharpness
from server.camera.sound import LiveSound
from server.camera.sources import Image, Source, open_source
from server.wire.config import Config
from server.wire.fit import Fit
from server.wire.messages import CameraTracks
from tracking import Detections, OnlineTracker, solver_named


class CameraPipeline:
    """Source, encoder, detector and tracker of one camera, without a clock and without a network.

    ``take`` and ``encode`` may run in one thread and ``track`` in another: they share nothing.

    Raises:
        UserError: the source or the detections cannot be opened.
    """

    def __init__(
        self, config: Config, camera_id: str, boot: int = 0, listener: LiveSound | None = None
    ) -> None:
        camera, site = config.camera(camera_id), config.site
        own = open_own(config, camera, listener)
        self.passes = own.source is not None
        """The source's own H.264 is passed on."""
        self.why_encoded = own.why
        """Why it is not, where it could have been; empty: nobody wished it."""
        self.source: Source = own.source or open_source(camera, site, listener)
        self._fit = Fit(self.source.size, (site.width, site.height))
        self._encoder = Passing(own.source) if own.source else Encoder(site, config.encode)
        self._detector = make_detector(config, camera, self._fit)
        window = config.track.window
        self._tracker = OnlineTracker(window, config.track.costs, solver_named(config.track.solver))
        self._reporter = Reporter(camera_id, boot, self.source.size, window.stride)
        self._sharpness = Sharpness() if config.view.quality.sharp > 0 else None
        self.begins = camera.offset if self.source.recorded else 0
        """The pulse at which the pictures begin."""
        self._last: int | None = None

    def take(self, pulse: int) -> Image | None:
        """Give the site-sized picture of a pulse, None where the source has none yet.

        Raises:
            SourceEnded: the recording is over.
        """
        own = self.source.take(pulse)
        return None if own is None else self._fit.image(own)

    def encode(self, pulse: int, image: Image) -> AccessUnit:
        """Encode the picture of a pulse, the last one that was taken."""
        return self._encoder.encode(pulse, image)

    def track(self, pulse: int, image: Image | None) -> CameraTracks | None:
        """Follow everybody into this frame; give the tracks when a window has ended.

        Pulses must grow. One that is left out, or has no image, is a frame in which nobody was seen; the
        camera's report says which those were, but for the time before a recording begins.
        """
        if self._last is not None:
            self._reporter.shed(range(self._last + 1, pulse))
        self._last = pulse
        if image is None:
            if pulse >= self.begins:
                self._reporter.shed([pulse])
            detections = Detections.empty(self._detector.bins)
        else:
            detections = self._detector.detect(image, pulse)
        result = self._tracker.push(pulse, detections)
        return None if result is None else self._measured(self._reporter.regular(result), image)

    def finish(self, end: int) -> CameraTracks:
        """Close the recording, which has no frame ``end``: what is provisional becomes final.

        A camera that was started again after its recording was over says so, too.
        """
        last = end - 1 if self._last is None else self._last
        return self._measured(self._reporter.closing(self._tracker.flush(), last), None)

    def _measured(self, tracks: CameraTracks, image: Image | None) -> CameraTracks:
        """Say how sharp everybody is, where that counts."""
        return tracks if self._sharpness is None else self._sharpness.measured(tracks, image)

    def close(self) -> None:
        """Let go of the source."""
        self.source.close()
