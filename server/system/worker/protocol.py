"""The protocol of a worker: each request has one answer; both are length-prefixed MessagePack.

The first message is the worker's settings; the answer is :data:`READY`.
"""

from __future__ import annotations

import msgspec

LENGTH_BYTES = 4
"""Bytes of the length before every message, big-endian."""
READY = bytes(LENGTH_BYTES)
"""An empty message, sent by a worker that has loaded its libraries."""


def encode_message(message: msgspec.Struct) -> bytes:
    """Return a message encoded for the pipe, preceded by its length."""
    body = msgspec.msgpack.encode(message)
    return len(body).to_bytes(LENGTH_BYTES, "big") + body
