"""The cameras as the operator sees them, and who listens to the pulses."""

from __future__ import annotations

import msgspec
import numpy as np
from aiohttp import web

from camsync import SyncError, query_clients
from server.config.pulse_access import pulse_clients
from server.http.access.grants import OPERATING
from server.http.api.handlers import answer
from server.http.api.responses import camera_info
from server.http.app_keys import SERVICE
from server.http.operator.schema import (
    Floor,
    FloorCamera,
    OperatorCamera,
    OperatorCameras,
    OwnPicture,
    PulseListener,
    Pulses,
)
from server.media.letterbox import Letterbox
from server.service.calibration.floor_map import floor_coverage
from server.service.ingest.ingest import CameraState
from server.service.service import BestViewService

routes = web.RouteTableDef()


@routes.get(f"{OPERATING}/cameras")
async def get_cameras(request: web.Request) -> web.Response:
    """Say how every camera is: state, rate, how far from the pulse, how late its tracks, what went wrong."""
    service = request.app[SERVICE]
    return answer(OperatorCameras([_camera(service, *it) for it in service.intake.states.items()]))


@routes.get(f"{OPERATING}/pulses")
async def get_pulses(request: web.Request) -> web.Response:
    """Ask the pulse server who its clients are."""
    service = request.app[SERVICE]
    sync, expected = service.config.sync, pulse_clients(service.config)
    where = f"{sync.host}:{sync.port}"
    try:
        clients = await query_clients(
            sync.host, sync.port, credentials=service.pulse_credentials, tls=service.pulse_tls
        )
    except SyncError as error:
        return answer(Pulses(where, str(error), [], []))
    listeners = [PulseListener(it.name, it.name in expected, it.behind) for it in clients]
    there = {it.name for it in clients}
    return answer(Pulses(where, "", listeners, [it for it in expected if it not in there]))


@routes.get(f"{OPERATING}/floor")
async def get_floor(request: web.Request) -> web.Response:
    """Say what the cameras cover of the floor that they share."""
    service = request.app[SERVICE]
    site = service.config.site
    cameras = []
    for camera in service.config.cameras:
        own = service.intake.states[camera.id].gauge.size
        if camera.ground is not None and own is not None:
            part = floor_coverage(np.array(camera.ground, dtype=np.float64), own, (site.width, site.height))
            cameras.append(FloorCamera(camera.id, part.homography.tolist(), part.outline.tolist()))
    return answer(Floor(cameras, [it.id for it in service.config.cameras if it.ground is None]))


def _camera(service: BestViewService, camera: str, state: CameraState) -> OperatorCamera:
    status, gauge = state.status, state.gauge
    return OperatorCamera(
        **msgspec.structs.asdict(camera_info(service, camera, state)),
        bad_messages=state.bad_messages,
        clock_offset=status.clock_offset if status else None,
        sync_error=gauge.sync_error,
        tracking_delay=gauge.tracking_delay,
        certified=gauge.certified,
        windows=gauge.windows,
        last_trouble=gauge.last_trouble,
        picture=None if gauge.size is None else _picture(service, gauge.size),
    )


def _picture(service: BestViewService, own: tuple[int, int]) -> OwnPicture:
    site = service.config.site
    fit = Letterbox(own, (site.width, site.height))
    left, top = fit.to_site(np.zeros(2)).tolist()
    return OwnPicture(width=own[0], height=own[1], scale=fit.scale, left=left, top=top)
