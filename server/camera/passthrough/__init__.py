"""A camera's own H.264, passed on as it is: where it fits, nothing has to be encoded."""

from __future__ import annotations

from server.camera.passthrough.encoder import PassthroughEncoder
from server.camera.passthrough.opening import PassthroughOpening, open_passthrough

__all__ = ["PassthroughEncoder", "PassthroughOpening", "open_passthrough"]
