"""Lets a library's settings dataclass be a section of the configuration, one to one."""

from __future__ import annotations

import dataclasses
import difflib
from functools import cache
from typing import Any, get_type_hints

from pydantic import BeforeValidator
from pydantic_core import PydanticCustomError

from server.config.values import abbreviate


def validated(settings: type) -> BeforeValidator:
    """Refuse keys that the dataclass does not have: pydantic would ignore them in a plain dataclass."""

    def check(value: Any) -> Any:
        _check(settings, value, "")
        return value

    return BeforeValidator(check)


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
            close = difflib.get_close_matches(str(key), names, n=1)
            hint = f"did you mean {close[0]!r}?" if close else f"known here: {', '.join(names)}"
            raise PydanticCustomError(
                "unknown_key",
                "{place}unknown key '{key}'; {hint}",
                {"place": place, "key": abbreviate(str(key)), "hint": hint},
            )
        if dataclasses.is_dataclass(types[key]):
            _check(types[key], inner, f"{place}{key}: ")
