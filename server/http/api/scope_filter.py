"""Scope filter: limits answers about the whole site to the person or the camera that a token permits."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable

import msgspec

from server.http.access.permissions import Scope
from server.http.api.schema import Cameras, Objects, SiteInfo
from server.http.streams.time_range import RecordedChoices
from server.messaging.messages import GopChoices
from server.service.facade.assist import Flag
from server.service.facade.rules import EventRecord

Resolve = Callable[[int], int]
"""Returns the current number of a person whose number may have been merged."""


def filter_site(site: SiteInfo, scope: Scope) -> SiteInfo:
    """Keep only the camera of the scope; for one person keep all, since any camera may see them.

    What is drawn blurred is H.264 without sound.
    """
    if scope.blur is not None:
        codec = site.codec and (site.h264 or site.codec)
        site = msgspec.structs.replace(
            site, codec=codec, container="mp4", h264=None, sound=None, blur=scope.blur
        )
    if scope.camera is None:
        return site
    return msgspec.structs.replace(
        site, cameras=[camera for camera in site.cameras if camera == scope.camera]
    )


def filter_objects(objects: Objects, scope: Scope, resolve: Resolve) -> Objects:
    """Keep only the person of the scope; leave out names and thumbnails where people are blurred."""
    if scope.blur is not None:
        nameless = [msgspec.structs.replace(info, name=None, thumbnail=None) for info in objects.objects]
        objects = Objects(nameless, objects.elsewhere)
    if scope.is_everywhere:
        return objects
    person = None if scope.object is None else resolve(scope.object)
    return Objects(
        [info for info in objects.objects if info.object == person],
        [info for info in objects.elsewhere if info.object == person],
    )


def filter_cameras(cameras: Cameras, scope: Scope) -> Cameras:
    """Keep only the camera of the scope; for one person keep all cameras, without their problems."""
    if scope.is_all:
        return cameras
    if scope.camera is not None:
        return Cameras([info for info in cameras.cameras if info.camera == scope.camera])
    return Cameras([msgspec.structs.replace(info, message="", retry_at=None) for info in cameras.cameras])


def filter_choices(choices: GopChoices, scope: Scope, resolve: Resolve) -> GopChoices:
    """Keep the decisions about the person of the scope, or the boxes in its camera."""
    if scope.is_everywhere:
        return choices
    if scope.object is None:
        boxes = {camera: frames for camera, frames in choices.boxes.items() if camera == scope.camera}
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
        cuts=[cut for cut in choices.cuts if cut.object in numbers],
        merged=[merge for merge in choices.merged if merge.kept in numbers],
        split=[split for split in choices.split if split.kept in numbers],
    )


def filter_flag(flag: Flag, scope: Scope, resolve: Resolve) -> Flag | None:
    """Limit a flag to the person or the camera of the scope; None: it concerns neither."""
    if scope.is_everywhere:
        return flag
    if scope.object is not None:
        person = resolve(scope.object)
        return msgspec.structs.replace(flag, objects=[person]) if person in flag.objects else None
    if scope.camera not in flag.cameras:
        return None
    return msgspec.structs.replace(flag, cameras=[scope.camera])


def filter_event(event: EventRecord, scope: Scope, resolve: Resolve) -> EventRecord | None:
    """Return an event about the person of the scope alone, without its picture; None: it is about others.

    Events have names and pictures, so there are none where people are blurred.
    """
    if scope.is_all:
        return event
    if (
        scope.blur is not None
        or scope.object is None
        or [resolve(number) for number in event.objects] != [resolve(scope.object)]
    ):
        return None
    return msgspec.structs.replace(event, picture=None)


async def filter_decisions(
    lines: AsyncIterator[bytes], scope: Scope, resolve: Resolve
) -> AsyncIterator[bytes]:
    """Filter recorded decisions, one line of JSON each.

    For a limited scope, drop decisions of earlier runs, in which its number may be another person's.
    """
    async for line in lines:
        if scope.is_all:
            yield line
            continue
        choices = msgspec.json.decode(line, type=RecordedChoices)
        if not choices.run:
            yield msgspec.json.encode(filter_choices(choices, scope, resolve)) + b"\n"
