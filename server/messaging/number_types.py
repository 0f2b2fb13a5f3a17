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
"""Unix seconds, or a difference of them; bounded so that sums stay finite."""

Cost = Annotated[float, msgspec.Meta(ge=-1e12, le=1e12)]
"""The cost of a solution, bounded for the same reason."""

Duration = Annotated[float, msgspec.Meta(ge=0, le=1e6)]
"""Seconds."""

COORDINATE_MAX = 1e6
"""The largest coordinate in pixels, either way."""

Coordinate = Annotated[float, msgspec.Meta(ge=-COORDINATE_MAX, le=COORDINATE_MAX)]
