"""Checks of values from YAML and JSON: depth, size, printable text, finite numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from server.system.address_redaction import redact_to_host
from server.system.errors import UserError

_MAX_DEPTH = 32
_MAX_VALUES = 1_000_000
"""A YAML alias counts each time it is used."""
_MAX_NUMBER = 1e15
_MAX_SHOWN = 40
_MAX_NAME = 64

_CONTAINERS = (dict, list, tuple, set)


def redact_and_abbreviate(key: str) -> str:
    """Return a key, shortened and redacted for an error line: it may be long, or an address by mistake."""
    key = redact_to_host(key)
    return key if len(key) <= _MAX_SHOWN else f"{key[:_MAX_SHOWN]}…"


def check_printable_name(name: str, where: str) -> None:
    """Check that a camera's name in a file is short and printable; the site need not have this camera.

    Raises:
        UserError: it is not; the text begins with ``where``.
    """
    if not name or len(name) > _MAX_NAME or not name.isprintable():
        raise UserError(f"{where}: camera {name[:_MAX_SHOWN]!a}: not a printable name")


def check_depth_and_texts(content: Any, where: str) -> None:
    """Check depth and size of nested values, and that all texts are one printable line.

    Raises:
        UserError: a value fails; the text begins with ``where``.
    """
    for place, value in _inside(content, where):
        if isinstance(value, str):
            try:
                value.encode()
            except UnicodeEncodeError:
                raise UserError(f"{where}: {_prefix(place)}has invalid characters") from None
            if value and value.splitlines() != [value]:
                raise UserError(f"{where}: {_prefix(place)}has more than one line")


def check_numbers(content: Any, where: str) -> None:
    """Check that all numbers are finite and small enough to add and multiply.

    Raises:
        UserError: a number is not; the text begins with ``where`` and names it.
    """
    for place, value in _inside(content, where):
        if isinstance(value, int | float) and not abs(value) <= _MAX_NUMBER:
            # Python refuses to write huge integers in decimal, but not in hexadecimal.
            text = str(value) if isinstance(value, float) else hex(value)
            raise UserError(f"{where}: {_prefix(place)}{text[:_MAX_SHOWN]} is too large a number")


def _prefix(place: tuple[Any, ...]) -> str:
    """Return the path of a value as the start of an error line."""
    words = (
        redact_and_abbreviate(" ".join(key.split())) if isinstance(key, str) else _short(key) for key in place
    )
    return f"{'.'.join(words)}: " if place else ""


def _short(key: Any) -> str:
    """Return a key that is not a string; Python refuses to write huge integers in decimal."""
    return "…" if isinstance(key, int) and abs(key) > _MAX_NUMBER else redact_and_abbreviate(str(key))


def _inside(content: Any, where: str) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Yield the path and value of each key and leaf."""
    left: list[tuple[tuple[Any, ...], Any]] = [((), content)] if isinstance(content, _CONTAINERS) else []
    count = 0
    while left:
        place, value = left.pop()
        count += len(value)
        if len(place) > _MAX_DEPTH or count > _MAX_VALUES:
            raise UserError(f"{where}: is nested too deeply, or too large")
        if isinstance(value, dict):
            yield from ((place, key) for key in value)
        for key, child in value.items() if isinstance(value, dict) else enumerate(value):
            if isinstance(child, _CONTAINERS):
                left.append(((*place, key), child))
            else:
                yield (*place, key), child
