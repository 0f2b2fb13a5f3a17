"""Deletion of a person's data: what would be deleted, and the deletion."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import msgspec

from client.http import HttpSettings, get_json, post_json, server_url

_PATH = "api/operator/deletion"
_SILENT_S = 600.0
"""Seconds in which a large recording is searched, or deleted from."""


class CameraLoss(msgspec.Struct, frozen=True):
    """What one camera's recording has of the person."""

    camera: str
    seen_s: float
    deleted_s: float
    """Seconds of its recording that go with the recordings: whole files do."""


class OtherLoss(msgspec.Struct, frozen=True):
    """Another person, whose recorded best view becomes shorter with the recordings."""

    object: int
    run: str | None
    name: str | None
    deleted_s: float


class PersonDeletion(msgspec.Struct, frozen=True):
    """What is deleted of a person, or would be."""

    object: int
    state: str
    """planned, running (it goes on) or done."""
    objects: tuple[int, ...]
    """All numbers of the person."""
    name: str | None
    visible: bool
    events: int
    decisions: int
    seen_s: float
    cameras: tuple[CameraLoss, ...]
    sound_s: float
    others: tuple[OtherLoss, ...]
    mentions: tuple[str, ...]
    """Where the site's files mention the person."""
    run: str | None = None
    recordings: str | None = None


async def plan_deletion(
    url: str, number: int, settings: HttpSettings, *, run: str | None = None
) -> PersonDeletion:
    """Return what would be deleted of object ``number``, in an earlier session ``run`` if one is named.

    Raises:
        ValueError: ``url`` is no address.
        NotFoundError: nobody has the number.
        ClientError: the server refuses, cannot be reached, or cannot read its recording.
    """
    query = {"object": str(number)} | ({} if run is None else {"run": run})
    return await get_json((server_url(url) / _PATH).with_query(query), PersonDeletion, _patient(settings))


async def delete_person(
    url: str,
    number: int,
    recordings: Literal["keep", "delete"],
    settings: HttpSettings,
    *,
    run: str | None = None,
) -> PersonDeletion:
    """Delete a person's data for good; errors as ``plan_deletion``."""
    content = {"object": number, "recordings": recordings} | ({} if run is None else {"run": run})
    return await post_json(server_url(url) / _PATH, content, PersonDeletion, _patient(settings))


def _patient(settings: HttpSettings) -> HttpSettings:
    return replace(settings, read_timeout=_SILENT_S, answer_timeout=_SILENT_S)
