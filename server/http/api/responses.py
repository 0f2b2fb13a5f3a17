"""The API's answers about the whole site, from the service's queries."""

from __future__ import annotations

import time

from server.http.api.schema import Cameras, Elsewhere, ObjectInfo, Objects, SiteInfo
from server.service.service import BestViewService


def site_info(service: BestViewService) -> SiteInfo:
    """Describe the site."""
    config, streams = service.config, service.streams
    return SiteInfo(
        name=config.site.name,
        fps=config.site.fps,
        width=config.site.width,
        height=config.site.height,
        gop=config.encode.gop,
        lookahead_frames=service.operations.view_settings.lookahead,
        codec=streams.codec,
        container=streams.container,
        sound=streams.audio_codec,
        pulse0=service.pulse0,
        now=time.time(),
        cameras=list(config.camera_ids),
    )


def objects_info(service: BestViewService) -> Objects:
    """List all people who have a stream, by number."""
    objects = [
        ObjectInfo(
            object=it.number,
            name=it.name,
            aliases=it.former_numbers,
            first_seen=it.first_seen,
            last_seen=it.last_seen,
            visible=bool(it.cameras),
            camera=it.camera,
            cameras=it.cameras,
            thumbnail=None
            if it.thumbnail_pulse is None
            else f"objects/{it.number}/thumb.jpg?v={it.thumbnail_pulse}",
        )
        for it in service.people.list_people()
    ]
    return Objects(objects, [Elsewhere(it.number, it.server) for it in service.people.list_remote_people()])


def cameras_info(service: BestViewService) -> Cameras:
    """List all cameras."""
    return Cameras(service.cameras.list_cameras())
