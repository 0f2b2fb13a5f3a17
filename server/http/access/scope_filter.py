"""What of an answer about the whole site somebody may see who may not see all of it."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable

import msgspec

from server.http.access.grants import Scope
from server.http.api.schema import Cameras, Objects, SiteInfo
from server.messaging.messages import GopChoices
from server.service.operator_assist.flags import Flag

Resolve = Callable[[int], int]
"""Gives the number that a merged one goes by now."""


def site_for(site: SiteInfo, sees: Scope) -> SiteInfo:
    """Name no camera but the one that somebody may see; who sees a person sees them by any."""
    if sees.camera is None:
        return site
    return msgspec.structs.replace(site, cameras=[it for it in site.cameras if it == sees.camera])


def objects_for(objects: Objects, sees: Scope, resolve: Resolve) -> Objects:
    """List nobody but the person whom somebody may see."""
    if sees.is_all:
        return objects
    person = None if sees.object is None else resolve(sees.object)
    return Objects([it for it in objects.objects if it.object == person], [])


def cameras_for(cameras: Cameras, sees: Scope) -> Cameras:
    """List the cameras that somebody may see; what is wrong with them is not for who sees one person."""
    if sees.is_all:
        return cameras
    if sees.camera is not None:
        return Cameras([it for it in cameras.cameras if it.camera == sees.camera])
    return Cameras([msgspec.structs.replace(it, message="") for it in cameras.cameras])


def choices_for(choices: GopChoices, sees: Scope, resolve: Resolve) -> GopChoices:
    """Tell of nobody but the person whom somebody may see, or of nothing but the boxes in their camera."""
    if sees.is_all:
        return choices
    if sees.object is None:
        boxes = {camera: it for camera, it in choices.boxes.items() if camera == sees.camera}
        return GopChoices(first=choices.first, frames=choices.frames, choices={}, boxes=boxes, cuts=[])
    person = resolve(sees.object)
    theirs = {sees.object, person}  # what was said before two numbers were merged names the old one
    return GopChoices(
        first=choices.first,
        frames=choices.frames,
        choices={number: camera for number, camera in choices.choices.items() if number in theirs},
        boxes={
            camera: [[box for box in frame if box[0] in theirs] for frame in frames]
            for camera, frames in choices.boxes.items()
        },
        cuts=[it for it in choices.cuts if it.object in theirs],
        merged=[it for it in choices.merged if it.kept in theirs],
        split=[it for it in choices.split if it.kept in theirs],
    )


def flag_for(flag: Flag, sees: Scope, resolve: Resolve) -> Flag | None:
    """Tell of a flag to who may see the person, or the camera, that it is about, and of nobody else; None."""
    if sees.is_all:
        return flag
    if sees.object is not None:
        person = resolve(sees.object)
        return msgspec.structs.replace(flag, objects=[person]) if person in flag.objects else None
    if sees.camera not in flag.cameras:
        return None
    return msgspec.structs.replace(flag, cameras=[it for it in flag.cameras if it == sees.camera])


async def told_for(lines: AsyncIterator[bytes], sees: Scope, resolve: Resolve) -> AsyncIterator[bytes]:
    """Tell the past again, line by line; to who may not see everything nothing of an earlier run.

    Under a number it is of somebody else.
    """
    async for line in lines:
        if sees.is_all:
            yield line
            continue
        choices = msgspec.json.decode(line, type=_Told)
        if not choices.run:
            yield msgspec.json.encode(choices_for(choices, sees, resolve)) + b"\n"


class _Told(GopChoices, frozen=True, kw_only=True):
    run: str = ""
