"""Detection of unknown configuration keys, with a suggestion of a similar key."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Sequence
from functools import cache
from typing import Any, get_type_hints

from pydantic import BeforeValidator
from pydantic_core import PydanticCustomError

from server.config.values import redact_and_abbreviate


def no_unknown_keys(settings: type) -> BeforeValidator:
    """Return a validator that refuses keys that a dataclass does not have: pydantic ignores them."""

    def check(value: Any) -> Any:
        _check(settings, value, "")
        return value

    return BeforeValidator(check)


def did_you_mean(key: str, known: Sequence[str]) -> str:
    """Return a "did you mean" question with a similar key; empty if none is similar."""
    close = difflib.get_close_matches(key, known, n=1)
    return f"did you mean {close[0]!r}?" if close else ""


@cache
def _types(settings: type) -> dict[str, Any]:
    return get_type_hints(settings)


def _check(settings: type, value: Any, place: str) -> None:
    if not isinstance(value, dict):
        return
    types = _types(settings)
    names = [field.name for field in dataclasses.fields(settings)]
    for key, inner in value.items():
        if key not in names:
            hint = did_you_mean(str(key), names) or f"known here: {', '.join(names)}"
            raise PydanticCustomError(
                "unknown_key",
                "{place}unknown key '{key}'; {hint}",
                {"place": place, "key": redact_and_abbreviate(str(key)), "hint": hint},
            )
        if dataclasses.is_dataclass(types[key]):
            _check(types[key], inner, f"{place}{key}: ")
