"""Bounded number types of bus messages."""

from __future__ import annotations

from typing import Annotated

import msgspec

PULSE_MAX = 2**40
"""A thousand years at 25 frames a second; the bound keeps times within 64 bits."""

Pulse = Annotated[int, msgspec.Meta(ge=0, le=PULSE_MAX)]
"""A frame number."""

Pixels = Annotated[int, msgspec.Meta(ge=1, le=2**16)]

Number = Annotated[int, msgspec.Meta(ge=0, le=2**62)]

Time = Annotated[float, msgspec.Meta(ge=-1e12, le=1e12)]
"""Unix seconds, or a difference of such: sums and differences of them are still numbers."""

Cost = Annotated[float, msgspec.Meta(ge=-1e12, le=1e12)]
"""What a solution costs, likewise."""

Duration = Annotated[float, msgspec.Meta(ge=0, le=1e6)]
"""Seconds."""

COORDINATE_MAX = 1e6
"""Pixels from a picture's corner, either way; what is farther is as far."""

Coordinate = Annotated[float, msgspec.Meta(ge=-COORDINATE_MAX, le=COORDINATE_MAX)]
