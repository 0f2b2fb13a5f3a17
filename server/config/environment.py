"""Checks of environment variables ``MYVIEW_SECTION__KEY`` before pydantic-settings reads them.

pydantic-settings ignores case, silently keeps one of two equal names, and drops unknown ones.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from server.config.duplicate_keys import DuplicateKeyError, parse_json
from server.config.site_config import PREFIX, Config
from server.system.errors import UserError

_DELIMITER = "__"


def check_environment(where: str) -> None:
    """Check that all environment variables name known settings, and no two name the same one.

    Raises:
        UserError: a variable is unknown (``MYVIEW_HTP__PORT``), or two set the same; begins with ``where``.
    """
    variables: dict[tuple[str, ...], str] = {}
    for name in sorted(os.environ):
        place = _place(name)
        if place is None:
            continue
        if place[0] not in Config.model_fields or (place[0] == "ground" and len(place) > 1):
            raise UserError(f"{where}: environment: {name}: there is no section {place[0]!r}")
        if place in variables:
            raise UserError(f"{where}: environment: {_both_set(variables[place], name, place)}")
        variables[place] = name
    for place, name in variables.items():
        try:
            _parsed(os.environ[name])
        except DuplicateKeyError as error:
            raise UserError(f"{where}: environment: {name}: {error}") from error
        for length in range(1, len(place)):
            outer = variables.get(place[:length])
            if outer is not None and _sets(_parsed(os.environ[outer]), place[length:]):
                raise UserError(f"{where}: environment: {_both_set(outer, name, place)}")


def environment_hint(place: Sequence[int | str]) -> str:
    """Return which variables set something at, in or around a setting's path; empty if none does."""
    keys = [str(key).lower() for key in place]
    names = [
        name
        for name in sorted(os.environ)
        if (path := _place(name)) and keys and all(a == b for a, b in zip(path, keys, strict=False))
    ]
    return f" (the environment sets {', '.join(names)})" if names else ""


def _place(name: str) -> tuple[str, ...] | None:
    """Return the path of a variable's setting; None: it is for something else, like MYVIEW_LOG."""
    if not name.upper().startswith(PREFIX):
        return None
    place = tuple(name[len(PREFIX) :].lower().split(_DELIMITER))
    return place if len(place) > 1 or place[0] in Config.model_fields else None


def _both_set(one: str, other: str, place: Sequence[str]) -> str:
    return f"{one} and {other} both set {'.'.join(place)}: remove one"


def _parsed(text: str) -> Any:
    """Parse a variable's value if it is JSON; otherwise return it unchanged.

    Raises:
        DuplicateKeyError: an object in it has a key twice.
    """
    try:
        return parse_json(text)
    except DuplicateKeyError:
        raise
    except (ValueError, RecursionError):
        return text


def _sets(content: Any, place: Sequence[str]) -> bool:
    """Return whether a section's content sets the key at a path, or is not a mapping."""
    for key in place:
        if not isinstance(content, dict):
            return True
        if key not in content:
            return False
        content = content[key]
    return True
