"""The settings in which two configurations differ."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from server.config.site_config import Config

_RESOLVED = "ground"
"""The file of all homographies; the loader has copied them to the cameras."""


def changed_keys(one: Config, other: Config) -> tuple[str, ...]:
    """Return the keys of settings that differ, such as ``view.switch_cost_s``, in the order of the reference.

    ``cameras`` alone means other cameras, or another order of cameras.
    """
    return tuple(key for name in Config.model_fields for key in _section(name, one, other))


def _section(name: str, one: Config, other: Config) -> Iterator[str]:
    if name == _RESOLVED:
        return
    if name != "cameras":
        yield from _inside(name, getattr(one, name), getattr(other, name))
    elif one.camera_ids != other.camera_ids:
        yield name
    else:
        for before, after in zip(one.cameras, other.cameras, strict=True):
            yield from _inside(f"{name}.{before.id}", before, after)


def _inside(key: str, before: Any, after: Any) -> Iterator[str]:
    if isinstance(before, BaseModel):
        names = list(type(before).model_fields)
    elif dataclasses.is_dataclass(before):
        names = [field.name for field in dataclasses.fields(before)]
    else:
        if before != after:
            yield key
        return
    for name in names:
        yield from _inside(f"{key}.{name}", getattr(before, name), getattr(after, name))
