"""How pictures are encoded."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, PositiveInt

from server.wire.sections.base import Section


class Encode(Section):
    """H.264. Identical in all cameras: that is what makes cutting without re-encoding possible."""

    gop: PositiveInt = 10
    """Frames in a closed group of pictures; views can change only where one begins."""
    crf: Annotated[int, Field(ge=0, le=51)] = 23
    """x264's constant quality: smaller is better and larger; 18 to 28 is sensible."""
    preset: Literal["ultrafast", "superfast", "veryfast", "faster", "fast", "medium"] = "ultrafast"
    max_kbps: Annotated[int, Field(ge=16)] | None = None
    """Kilobits that a camera's pictures take in any second at most; None: as many as the quality wants."""
