"""A message from the bus with something in it wrong."""

from __future__ import annotations

from random import Random

import msgspec

from benchmarks.fuzz.engine.mutations import as_json, damaged, otherwise
from server.messaging.inbox import Message


def wrong(rng: Random, message: Message) -> Message:
    """Return a message with something in it wrong: a value, a byte, its key."""
    key, payload, head = message.key, message.payload, message.attachment
    way = rng.random()
    if way < 0.55:
        json = head or payload
        changed = as_json(otherwise(rng, msgspec.json.decode(json)))
        return Message(key, payload, changed) if head else Message(key, changed, b"")
    if way < 0.75:
        return Message(key, damaged(rng, payload), head)
    if way < 0.9:
        return Message(key, payload, damaged(rng, head))
    other = rng.choice(
        (
            key.replace("c0", "c1"),
            key.replace("c1", "cellar"),
            damaged(rng, key.encode()).decode("utf-8", "replace"),
        )
    )
    return Message(other, payload, head)
