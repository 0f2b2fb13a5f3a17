"""Checks of values from YAML and JSON: depth, size, printable text, finite numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from server.system.address_redaction import redact_address
from server.system.errors import UserError

_DEEPEST = 32
_MOST = 1_000_000
"""Values; a YAML alias counts each time it is referred to."""
_LARGEST = 1e15
_SHOWN = 40
_LONGEST_NAME = 64

_HOLDING = (dict, list, tuple, set)


def abbreviate(key: str) -> str:
    """Return a key, shortened and redacted for an error line: it may be long, or an address by mistake."""
    key = redact_address(key)
    return key if len(key) <= _SHOWN else f"{key[:_SHOWN]}…"


def check_camera_name(name: str, where: str) -> None:
    """Check that a camera's name in a file is short and printable; it need not be one of the site's.

    Raises:
        UserError: it cannot; the text begins with ``where``.
    """
    if not name or len(name) > _LONGEST_NAME or not name.isprintable():
        raise UserError(f"{where}: camera {name[:_SHOWN]!a}: not a printable name")


def check_values(content: Any, where: str) -> None:
    """Check depth and size of nested values, and that all texts are one printable line.

    Raises:
        UserError: a value fails; the text begins with ``where``.
    """
    for place, value in _inside(content, where):
        if isinstance(value, str):
            try:
                value.encode()
            except UnicodeEncodeError:
                raise UserError(f"{where}: {_named(place)}has invalid characters") from None
            if value and value.splitlines() != [value]:
                raise UserError(f"{where}: {_named(place)}has more than one line")


def check_numbers(content: Any, where: str) -> None:
    """Check that all numbers are finite and small enough to add and multiply.

    Raises:
        UserError: one is too large for that; the text begins with ``where`` and names it.
    """
    for place, value in _inside(content, where):
        if isinstance(value, int | float) and not abs(value) <= _LARGEST:
            # Python writes no number of thousands of digits, but in hexadecimal it does.
            written = str(value) if isinstance(value, float) else hex(value)
            raise UserError(f"{where}: {_named(place)}{written[:_SHOWN]} is too large a number")


def _named(place: tuple[Any, ...]) -> str:
    """Return the path of a value as the beginning of an error line."""
    words = (abbreviate(" ".join(it.split())) if isinstance(it, str) else _short(it) for it in place)
    return f"{'.'.join(words)}: " if place else ""


def _short(key: Any) -> str:
    """Return a key that is no text; Python writes no number of thousands of digits."""
    return "…" if isinstance(key, int) and abs(key) > _LARGEST else abbreviate(str(key))


def _inside(content: Any, where: str) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Yield the path and value of each key and leaf."""
    left: list[tuple[tuple[Any, ...], Any]] = [((), content)] if isinstance(content, _HOLDING) else []
    seen = 0
    while left:
        place, value = left.pop()
        seen += len(value)
        if len(place) > _DEEPEST or seen > _MOST:
            raise UserError(f"{where}: is nested too deeply, or too large")
        if isinstance(value, dict):
            yield from ((place, key) for key in value)
        for key, it in value.items() if isinstance(value, dict) else enumerate(value):
            if isinstance(it, _HOLDING):
                left.append(((*place, key), it))
            else:
                yield (*place, key), it
