"""The pictures in which a camera's people are tracked: of its substream, or of its only stream."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Protocol

from server.camera.captured_frame import CapturedFrame
from server.camera.passthrough.encoder import PassthroughSource
from server.camera.passthrough.recording_source import PassthroughRecording
from server.camera.sources import FrameSource, Image, ImageFolder, Recording, SourceEndedError
from server.camera.sources.orientation import parse_orientation
from server.camera.sources.stream_clock import CaptureTime
from server.camera.substream.live_substream import LiveSubstream
from server.camera.substream.picture_buffer import PictureRequest
from server.camera.substream.picture_scale import PictureScale, SubstreamPlacement
from server.media.letterbox import Letterbox
from server.messaging.camera_status import SUBSTREAM_AWAY, SubstreamState

log = logging.getLogger(__name__)

_WAIT_S = 0.5
"""Seconds by which the substream may be later than the main stream."""
_AWAY_S = 1.5
"""Seconds without pictures of the right time after which the main stream is used."""


class TrackedPictures(Protocol):
    """Finds the picture in which people are tracked. Used from one thread at a time."""

    scale: PictureScale
    """Of that picture."""
    state: SubstreamState
    """Whether a substream delivers it."""
    waited_s: float
    """Seconds that the last image was waited for."""

    def request(self, captured: CaptureTime | None) -> PictureRequest | None:
        """Look for the picture captured at a time already now; it may be needed much later."""
        ...

    def image(self, frame: CapturedFrame) -> Image | None:
        """Return the picture captured at the time of a frame, at the tracked size; None: there is none.

        May wait for it.
        """
        ...

    def prescan_images(self, indices: Sequence[int]) -> Iterator[Image]:
        """Return a recording's pictures with these ascending indices, at the tracked size."""
        ...

    def close(self) -> None:
        """Close the substream."""
        ...


class MainPictures:
    """Tracks in the pictures that are shown."""

    state: SubstreamState = "none"
    waited_s = 0.0

    def __init__(self, source: FrameSource, letterbox: Letterbox) -> None:
        self._source, self._letterbox = source, letterbox
        self.scale = PictureScale(letterbox.site_size, letterbox.site_size)

    def request(self, captured: CaptureTime | None) -> PictureRequest | None:  # noqa: ARG002 — TrackedPictures
        """Return None: the frame has it."""
        return None

    def image(self, frame: CapturedFrame) -> Image | None:
        """Return the frame's own picture."""
        return frame.image

    def prescan_images(self, indices: Sequence[int]) -> Iterator[Image]:
        """Return a recording's pictures with these ascending indices."""
        return (self._letterbox.image(image) for image in self._source.prescan_images(indices))

    def close(self) -> None:
        """Close nothing: the source is the pipeline's."""


class LiveSubstreamPictures:
    """Tracks in the pictures of a network camera's substream; while it is away, in those of the main stream.

    Args:
        camera: the camera's id, for the log.
        reader: the substream.
        placement: of its pictures.
        scale: of the tracked picture.
        passthrough: the main stream if it is passed through: it is decoded only while the substream is away.
    """

    def __init__(
        self,
        camera: str,
        reader: LiveSubstream,
        placement: SubstreamPlacement,
        scale: PictureScale,
        passthrough: PassthroughSource | None,
    ) -> None:
        self._camera, self._reader, self._placement = camera, reader, placement
        self.scale, self._passthrough = scale, passthrough
        self.state: SubstreamState = "live"
        self.waited_s = 0.0
        self._found_at = time.monotonic()

    def request(self, captured: CaptureTime | None) -> PictureRequest | None:
        """Look for the picture captured at a time already now."""
        return None if captured is None else self._reader.request(captured)

    def image(self, frame: CapturedFrame) -> Image | None:
        """Return the substream's picture of the frame's moment, or else the frame's own, if it has one."""
        found, began = None, time.monotonic()
        if frame.request is not None:
            found = self._reader.wait(frame.request, frame.taken + _WAIT_S)
        now = time.monotonic()
        self.waited_s = now - began
        if found is not None:
            self._found_at = now
            self._set_state("live")
            orientation = parse_orientation(found.picture)
            shape = None
            if found.pixel_aspect != 1.0:
                stored = found.picture.width, found.picture.height
                shape = replace(orientation, pixel_aspect=found.pixel_aspect).size(stored)
            return self._placement.image(orientation.image(found.picture), shape)
        if now - self._found_at > _AWAY_S:
            self._set_state("away")
        return None if frame.image is None else self.scale.image(frame.image)

    def prescan_images(self, indices: Sequence[int]) -> Iterator[Image]:  # noqa: ARG002 — TrackedPictures
        """Return nothing: a live camera has no future frames."""
        return iter(())

    def close(self) -> None:
        """Stop reading."""
        self._reader.close()

    def _set_state(self, state: SubstreamState) -> None:
        if self._passthrough is not None:
            self._passthrough.decodes = state == "away"
        if state == self.state:
            return
        self.state = state
        if state == "away":
            log.warning("camera %s: %s", self._camera, SUBSTREAM_AWAY)
        else:
            log.info("camera %s: people are tracked in its substream again", self._camera)


class RecordedSubstreamPictures:
    """Tracks in a second recording, frame by frame; after its end in the first one, where that is decoded.

    Args:
        camera: the camera's id, for the log.
        main: the recording that is shown.
        source: the second one.
        placement: of its pictures.
        scale: of the tracked picture.
    """

    waited_s = 0.0

    def __init__(
        self,
        camera: str,
        main: FrameSource,
        source: FrameSource,
        placement: SubstreamPlacement,
        scale: PictureScale,
    ) -> None:
        self._camera, self._main, self._source = camera, main, source
        self._placement, self.scale = placement, scale
        self._has_true_shape = isinstance(source, Recording) and source.orientation.pixel_aspect != 1.0
        self.state: SubstreamState = "live"

    def request(self, captured: CaptureTime | None) -> PictureRequest | None:  # noqa: ARG002 — TrackedPictures
        """Return None: it is read when it is needed."""
        return None

    def image(self, frame: CapturedFrame) -> Image | None:
        """Return the second recording's picture of the frame's moment, or else the frame's own, if any."""
        pulse = frame.pulse
        if isinstance(self._main, Recording | PassthroughRecording | ImageFolder):
            pulse = self._main.pulse_in_first_pass(pulse)
        try:
            image = self._source.take(pulse)
        except SourceEndedError:
            if self.state == "live":
                log.warning("camera %s: its substream ends before its source", self._camera)
            self.state = "away"
            return None if frame.image is None else self.scale.image(frame.image)
        self.state = "live"
        return None if image is None else self._placed(image)

    def prescan_images(self, indices: Sequence[int]) -> Iterator[Image]:
        """Return the second recording's pictures with these ascending indices."""
        return (self._placed(image) for image in self._source.prescan_images(indices))

    def close(self) -> None:
        """Close the second recording."""
        self._source.close()

    def _placed(self, image: Image) -> Image:
        return self._placement.image(image, image.shape[1::-1] if self._has_true_shape else None)
