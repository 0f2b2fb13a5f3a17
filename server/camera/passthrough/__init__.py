"""Passthrough of a camera's own video, where it fits the site's streams."""

from __future__ import annotations

from server.camera.passthrough.encoder import PassthroughEncoder
from server.camera.passthrough.opening import PassthroughOpening, open_passthrough

__all__ = ["PassthroughEncoder", "PassthroughOpening", "open_passthrough"]
