"""The section `encode`: video encoding."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from server.config.sections.base import Section
from tracking.frame_rate import frames_in


class EncodeSettings(Section):
    """Encoder settings, equal in all cameras, so that views can be cut without re-encoding."""

    codec: Literal["h264", "h265", "vp8"] = "h264"
    """H.264 (x264) or H.265 (x265) in MP4, or VP8 (libvpx) in WebM: free of patents' and the GPL's terms."""
    gop_s: Annotated[float, Field(gt=0, le=60)] = 0.4
    """Seconds of a closed group of pictures, at least one frame; views can change only where one begins."""
    crf: Annotated[int, Field(ge=0, le=51)] = 23
    """x264's or x265's constant quality: smaller is better and larger; 18 to 28 is sensible."""
    preset: Literal["ultrafast", "superfast", "veryfast", "faster", "fast", "medium"] = "ultrafast"
    max_kbps: Annotated[int, Field(ge=16)] | None = None
    """Kilobits of a camera's pictures in any second at most; None: as many as the quality needs."""
    parameters: Literal["equal", "own"] = "equal"
    """Parameter sets of H.264 or H.265: equal in all cameras, or own ones where a camera passes through."""
    quantizer: Annotated[int, Field(ge=0, le=63)] = 16
    """VP8's constant quality, instead of crf: smaller is better and larger; 8 to 32 is sensible."""
    speed: Annotated[int, Field(ge=1, le=16)] = 10
    """VP8's, instead of preset: higher is quicker, and a little larger."""

    def frames_per_gop(self, fps: float) -> int:
        """Return the frames in a GOP at so many frames per second."""
        return frames_in(self.gop_s, fps)

    @model_validator(mode="after")
    def _can_be_capped(self) -> Self:
        if self.codec == "vp8" and self.max_kbps is not None:
            raise ValueError("max_kbps: VP8's encoder cannot cap every second; use codec: h264")
        return self
