"""What numbers on the bus may be."""

from __future__ import annotations

from typing import Annotated

import msgspec

Pulse = Annotated[int, msgspec.Meta(ge=0, le=2**40)]
"""A frame number; the bound is a thousand years at 25 frames a second, and keeps times within 64 bits."""

Pixels = Annotated[int, msgspec.Meta(ge=1, le=2**16)]

Number = Annotated[int, msgspec.Meta(ge=0, le=2**62)]

Duration = Annotated[float, msgspec.Meta(ge=0, le=1e6)]
"""Seconds."""

Coordinate = Annotated[float, msgspec.Meta(ge=-1e6, le=1e6)]
