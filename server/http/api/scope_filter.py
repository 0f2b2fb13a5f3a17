"""Scope filter: of an answer about the whole site, what a token for one person or one camera may see."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable

import msgspec

from server.http.access.permissions import Scope
from server.http.api.schema import Cameras, Objects, SiteInfo
from server.messaging.messages import GopChoices
from server.service.facade.assist import Flag

Resolve = Callable[[int], int]
"""Returns the number that a merged one goes by now."""


def filter_site(site: SiteInfo, scope: Scope) -> SiteInfo:
    """Keep the camera of the scope; a person may be seen by any camera."""
    if scope.camera is None:
        return site
    return msgspec.structs.replace(site, cameras=[it for it in site.cameras if it == scope.camera])


def filter_objects(objects: Objects, scope: Scope, resolve: Resolve) -> Objects:
    """Keep the person of the scope."""
    if scope.is_all:
        return objects
    person = None if scope.object is None else resolve(scope.object)
    return Objects([it for it in objects.objects if it.object == person], [])


def filter_cameras(cameras: Cameras, scope: Scope) -> Cameras:
    """Keep the camera of the scope; for one person keep all cameras, without their error messages."""
    if scope.is_all:
        return cameras
    if scope.camera is not None:
        return Cameras([it for it in cameras.cameras if it.camera == scope.camera])
    return Cameras([msgspec.structs.replace(it, message="") for it in cameras.cameras])


def filter_choices(choices: GopChoices, scope: Scope, resolve: Resolve) -> GopChoices:
    """Keep what is about the person of the scope, or the boxes in its camera."""
    if scope.is_all:
        return choices
    if scope.object is None:
        boxes = {camera: it for camera, it in choices.boxes.items() if camera == scope.camera}
        return GopChoices(first=choices.first, frames=choices.frames, choices={}, boxes=boxes, cuts=[])
    person = resolve(scope.object)
    numbers = {scope.object, person}  # decisions from before a merge have the old number
    return GopChoices(
        first=choices.first,
        frames=choices.frames,
        choices={number: camera for number, camera in choices.choices.items() if number in numbers},
        boxes={
            camera: [[box for box in frame if box[0] in numbers] for frame in frames]
            for camera, frames in choices.boxes.items()
        },
        cuts=[it for it in choices.cuts if it.object in numbers],
        merged=[it for it in choices.merged if it.kept in numbers],
        split=[it for it in choices.split if it.kept in numbers],
    )


def filter_flag(flag: Flag, scope: Scope, resolve: Resolve) -> Flag | None:
    """Keep what a flag says about the person or the camera of the scope; None: it is not about them."""
    if scope.is_all:
        return flag
    if scope.object is not None:
        person = resolve(scope.object)
        return msgspec.structs.replace(flag, objects=[person]) if person in flag.objects else None
    if scope.camera not in flag.cameras:
        return None
    return msgspec.structs.replace(flag, cameras=[it for it in flag.cameras if it == scope.camera])


async def filter_decisions(
    lines: AsyncIterator[bytes], scope: Scope, resolve: Resolve
) -> AsyncIterator[bytes]:
    """Filter recorded decisions, a line of JSON each.

    A limited scope sees nothing of an earlier run, in which its number may be another person's.
    """
    async for line in lines:
        if scope.is_all:
            yield line
            continue
        choices = msgspec.json.decode(line, type=_RecordedChoices)
        if not choices.run:
            yield msgspec.json.encode(filter_choices(choices, scope, resolve)) + b"\n"


class _RecordedChoices(GopChoices, frozen=True, kw_only=True):
    run: str = ""
    """The earlier run that it is of; empty: of this one."""
