"""Values as YAML and JSON have them, before anybody looks at what they mean."""

from __future__ import annotations

from typing import Any

from server.wire.errors import UserError

_DEEPEST = 32
_MOST = 1_000_000
"""Values; an alias that YAML refers to again counts again, as it does for whoever reads it."""
_SHOWN = 40


def check_values(content: Any, where: str) -> None:
    """Look that values end somewhere, and that their texts are texts.

    Raises:
        UserError: they do not, or are not; the text begins with ``where``.
    """
    left: list[tuple[Any, int]] = [(content, 0)]
    seen = 0
    while left:
        value, depth = left.pop()
        seen += 1
        if depth > _DEEPEST or seen > _MOST:
            raise UserError(f"{where}: is nested without end, or larger than any configuration")
        if isinstance(value, str):
            _check_text(value, where)
        elif isinstance(value, dict):
            left += ((it, depth + 1) for pair in value.items() for it in pair)
        elif isinstance(value, list | tuple | set):
            left += ((it, depth + 1) for it in value)


def _check_text(text: str, where: str) -> None:
    try:
        text.encode()
    except UnicodeEncodeError:
        raise UserError(f"{where}: {text[:_SHOWN]!a}: has characters that are none") from None
