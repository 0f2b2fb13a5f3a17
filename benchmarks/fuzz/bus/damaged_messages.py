"""Mutations of messages from the bus."""

from __future__ import annotations

from random import Random

import msgspec

from benchmarks.fuzz.engine.mutations import as_message, mutate_bytes, mutate_value
from server.messaging.inbox import Message


def damaged_message(rng: Random, message: Message) -> Message:
    """Return a damaged message: a wrong value, byte or key."""
    key, payload, head = message.key, message.payload, message.attachment
    choice = rng.random()
    if choice < 0.55:
        changed = as_message(mutate_value(rng, msgspec.msgpack.decode(head or payload)))
        return Message(key, payload, changed) if head else Message(key, changed, b"")
    if choice < 0.75:
        return Message(key, mutate_bytes(rng, payload), head)
    if choice < 0.9:
        return Message(key, payload, mutate_bytes(rng, head))
    other = rng.choice(
        (
            key.replace("c0", "c1"),
            key.replace("c1", "cellar"),
            mutate_bytes(rng, key.encode()).decode("utf-8", "replace"),
        )
    )
    return Message(other, payload, head)
