"""A camera's own H.264, passed on as it is: where it fits, nothing has to be encoded."""

from __future__ import annotations

from server.camera.own.opening import Own, open_own
from server.camera.own.passing import Passing

__all__ = ["Own", "Passing", "open_own"]
