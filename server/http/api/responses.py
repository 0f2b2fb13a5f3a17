"""API answers about the whole site: its settings, people and cameras."""

from __future__ import annotations

import time

from server.http.access.permissions import Scope
from server.http.api.schema import Cameras, Delays, ObjectInfo, Objects, SiteInfo
from server.service.facade.streams import DelayMode
from server.service.service import BestViewService

_RENDERED_CODEC = "avc1.42C028"
"""Of what the server encodes anew: H.264, Constrained Baseline."""


def site_info(service: BestViewService) -> SiteInfo:
    """Return the site's settings."""
    config, streams = service.config, service.streams
    return SiteInfo(
        name=config.site.name,
        fps=config.site.fps,
        width=config.site.width,
        height=config.site.height,
        gop=config.gop,
        lookahead_s=config.lookahead_of(service.operations.view_settings) / config.site.fps,
        codec=streams.codec,
        container=streams.container,
        h264=None if config.encode.codec == "h264" else _RENDERED_CODEC,
        sound=streams.audio_codec,
        pulse0=service.pulse0,
        now=time.time(),
        cameras=list(config.camera_ids),
        others=service.people.replacements,
        blur=None,
    )


def delays_info(service: BestViewService, scope: Scope) -> Delays:
    """Return the delays that viewers of a scope may choose; live only if they see all, and unblurred."""
    has_live = scope.object is None and scope.blur is None
    return Delays([delay for delay in service.streams.delays() if has_live or delay.delay != DelayMode.LIVE])


def objects_info(service: BestViewService, token: str | None = None) -> Objects:
    """Return all people who have a stream, by number; ``token`` is the SHA-256 of the viewer's."""
    objects = [
        ObjectInfo(
            object=person.number,
            name=person.name,
            aliases=person.former_numbers,
            first_seen=person.first_seen,
            last_seen=person.last_seen,
            visible=bool(person.cameras),
            camera=person.camera,
            cameras=person.cameras,
            thumbnail=None
            if person.thumbnail_pulse is None
            else f"objects/{person.number}/thumb.jpg?v={person.thumbnail_pulse}",
        )
        for person in service.people.list_people()
    ]
    return Objects(objects, [*service.people.list_elsewhere(), *service.sites.list_elsewhere(token)])


def cameras_info(service: BestViewService) -> Cameras:
    """Return the state of all cameras."""
    return Cameras(service.cameras.list_cameras())
