"""Mutations of inputs: of bytes, and of JSON and YAML values.

All randomness is from the caller's ``rng``, so that an input can be reproduced from its number.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from random import Random
from typing import Any

import msgspec

WORDS = (
    b"\x00",
    b"\n",
    b"\r\n",
    b"\xff",
    b"\xc3\x28",
    b"\xed\xa0\x80",
    b"\\ud800",
    b"-1",
    b"0",
    b"1e308",
    b"1e999",
    b"-1e999",
    b"nan",
    b"NaN",
    b"Infinity",
    b"-.inf",
    b"9" * 30,
    b"9" * 5000,
    b"18446744073709551616",
    b"4294967295",
    b"null",
    b"[" * 2000,
    b"[" * 60,
    b'{"a":' * 1000,
    b" " * 300,
    b"\x7f\xff\xff\xff",
    b"\xff\xff\xff\xff",
    b"\x00\x00\x00\x01",
)
"""Typical problematic input: invalid text, invalid and huge numbers, deep nesting."""

_DIGIT = re.compile(rb"[0-9]")
_SPAN = 24
_MAX_BYTES = 100_000
_DEEP = 60

_ODD: tuple[Callable[[Random], Any], ...] = (
    lambda _: None,
    lambda _: True,
    lambda _: "",
    lambda _: "x",
    lambda rng: "9" * rng.randrange(1, 400),
    lambda rng: chr(rng.choice((0, 10, 0x2028, 0xD800, 0x1F600))) * 3,
    lambda _: "nan",
    lambda _: [],
    lambda _: {},
    lambda _: -1,
    lambda _: 0,
    lambda rng: rng.randrange(-10, 200),
    lambda rng: rng.choice((-1, 1)) << rng.randrange(1, 70),
    lambda _: 10**400,
    lambda rng: rng.choice((0.5, -0.0, 1e-300, 1e9, 1e154, 1e308, -1e308)),
    lambda rng: rng.choice((float("nan"), float("inf"), -float("inf"))),
    lambda rng: nested(rng.randrange(1, _DEEP)),
    lambda rng: [rng.random() for _ in range(rng.randrange(8))],
)


def mutate_bytes(rng: Random, data: bytes, words: Sequence[bytes] = WORDS) -> bytes:
    """Return the bytes with one to four mutations."""
    for _ in range(rng.choice((1, 1, 1, 2, 2, 3, 4))):
        data = rng.choice(_BYTE_MUTATIONS)(rng, data, words)
    return data[:_MAX_BYTES]


def odd(rng: Random) -> Any:
    """Return an unexpected value."""
    return rng.choice(_ODD)(rng)


def nested(depth: int) -> Any:
    """Return nested lists."""
    value: Any = []
    for _ in range(depth):
        value = [value]
    return value


def mutate_value(rng: Random, value: Any) -> Any:
    """Return a copy of a value with one mutation: an unexpected, missing, duplicated or retyped part."""
    if isinstance(value, dict) and value and rng.random() < _DESCEND:
        key = rng.choice(list(value))
        return {**value, key: mutate_value(rng, value[key])}
    if isinstance(value, list) and value and rng.random() < _DESCEND:
        at = rng.randrange(len(value))
        return [*value[:at], mutate_value(rng, value[at]), *value[at + 1 :]]
    return rng.choice(_mutations(value))(rng)


_DESCEND = 0.85


def _mutations(value: Any) -> Sequence[Callable[[Random], Any]]:
    if isinstance(value, dict):
        return (
            odd,
            lambda rng: {**value, odd_key(rng): odd(rng)},
            lambda rng: _without_key(rng, value),
            lambda _: list(value.items()),
        )
    if isinstance(value, list):
        return (
            odd,
            lambda _: [*value, *value],
            lambda rng: value[: rng.randrange(len(value) + 1)],
            lambda rng: [*value, odd(rng)],
            lambda rng: rng.sample(value, len(value)),
        )
    if isinstance(value, bytes):
        return (odd, lambda rng: mutate_bytes(rng, value))
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return (odd,)
    return (
        odd,
        lambda _: -value,
        lambda _: value + 1,
        lambda rng: value + rng.randrange(-20, 20),
        lambda rng: value * rng.choice((2, 10, 1000, 10**9)),
        lambda _: str(value),
    )


def odd_key(rng: Random) -> str:
    """Return an unexpected key."""
    return rng.choice(("", "x", "0", "camera", "\ud800", "a" * 300, "id"))


def _without_key(rng: Random, value: dict[str, Any]) -> dict[str, Any]:
    removed = rng.choice(list(value)) if value else ""
    return {key: item for key, item in value.items() if key != removed}


def as_message(value: Any) -> bytes:
    """Encode a value as MessagePack, or as JSON what that cannot hold, such as long integers."""
    try:
        return msgspec.msgpack.encode(value)
    except (OverflowError, UnicodeEncodeError, RecursionError):
        return as_json(value)


def as_json(value: Any) -> bytes:
    """Encode a value as JSON, including Python's non-standard numbers; bytes as text."""
    return json.dumps(value, default=bytes.hex).encode()


def _flip(rng: Random, data: bytes, _: Sequence[bytes]) -> bytes:
    if not data:
        return data
    at = rng.randrange(len(data))
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def _replace(rng: Random, data: bytes, _: Sequence[bytes]) -> bytes:
    if not data:
        return data
    at = rng.randrange(len(data))
    return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]


def _cut(rng: Random, data: bytes, _: Sequence[bytes]) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at]


def _delete(rng: Random, data: bytes, _: Sequence[bytes]) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + data[at + rng.randrange(1, _SPAN) :]


def _double(rng: Random, data: bytes, _: Sequence[bytes]) -> bytes:
    at = rng.randrange(len(data) + 1)
    end = at + rng.randrange(1, _SPAN * 4)
    return data[:end] + data[at:end] * rng.choice((1, 1, 2, 20)) + data[end:]


def _insert_bytes(rng: Random, data: bytes, _: Sequence[bytes]) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.randbytes(rng.randrange(1, 9)) + data[at:]


def _insert_word(rng: Random, data: bytes, words: Sequence[bytes]) -> bytes:
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.choice(words) + data[at + rng.choice((0, 0, 1, 4)) :]


def _renumber(rng: Random, data: bytes, words: Sequence[bytes]) -> bytes:
    """Replace a decimal number."""
    digits = [match.start() for match in _DIGIT.finditer(data, 0, 2000)]
    if not digits:
        return _insert_word(rng, data, words)
    at = end = rng.choice(digits)
    while end < len(data) and 48 <= data[end] <= 57:
        end += 1
    return data[:at] + rng.choice(_NUMBERS) + data[end:]


def _move(rng: Random, data: bytes, _: Sequence[bytes]) -> bytes:
    a, b, c = sorted(rng.randrange(len(data) + 1) for _ in range(3))
    return data[:a] + data[b:c] + data[a:b] + data[c:]


_NUMBERS: tuple[bytes, ...] = (
    b"0",
    b"-1",
    b"1",
    b"2",
    b"255",
    b"65536",
    b"4294967296",
    b"9223372036854775808",
    b"1e300",
    b"9" * 40,
)
_BYTE_MUTATIONS = (
    _flip,
    _flip,
    _replace,
    _cut,
    _delete,
    _double,
    _insert_bytes,
    _insert_word,
    _insert_word,
    _renumber,
    _renumber,
    _move,
)
