"""A camera's own H.264, passed on as it is: where it fits, nothing has to be encoded."""

from __future__ import annotations

from server.camera.passthrough.encoder import Passing
from server.camera.passthrough.opening import Own, open_own

__all__ = ["Own", "Passing", "open_own"]
