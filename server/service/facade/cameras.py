"""Cameras: their state, diagnostics, and coverage of the floor."""

from __future__ import annotations

from typing import Annotated

import msgspec
import numpy as np

from server.media.letterbox import Letterbox
from server.messaging.picture_motion import moved_homography
from server.service.calibration.floor_map import floor_coverage
from server.service.facade.errors import UnknownCameraError
from server.service.identity.sharding import shard_address
from server.service.ingest.camera_state import CameraState
from server.service.metrics.camera_metrics import CameraProblem, RecentSeconds
from server.service.pipeline import BestViewPipeline


class CameraInfo(msgspec.Struct, frozen=True):
    """One camera."""

    camera: str
    state: str
    """starting, live, gone, ended or refused."""
    pulse: int
    """The newest frame."""
    late: int
    """Epochs whose tracks came too late."""
    fps: float
    missed: int
    shed: int
    load_level: int
    """Load-shedding level; 0: none."""
    synchronized: bool
    """Pulses come from the server; otherwise the camera counts by itself."""
    message: Annotated[str, msgspec.Meta(description="A problem; empty: none.")]
    retry_at: Annotated[
        float | None,
        msgspec.Meta(
            description="When its source, which is lost or unusable, is opened again, unix seconds; null: "
            "now, or it is open."
        ),
    ]
    condition: str
    """What is wrong with the picture: clear, covered, turned, blurred, noisy or frozen."""
    condition_since: float | None
    """When that began, unix seconds; null: nothing is wrong."""
    covered_share: float
    """The share of the picture that something on the lens hides, also if the rest is clear."""


class ImagePlacement(msgspec.Struct, frozen=True):
    """A camera's image size, and its placement: site pixel = camera pixel · scale + (left, top)."""

    width: int
    height: int
    scale: float
    left: float
    top: float


class CameraDiagnostics(CameraInfo, frozen=True):
    """One camera's diagnostics: the fields of /api/cameras, and more."""

    bad_messages: int
    clock_offset: float | None
    """Seconds, pulse server's clock minus the camera's; null: unknown."""
    sync_error: RecentSeconds | None
    """Seconds from a pulse to the capture of its frame, over about the last ten seconds."""
    tracking_delay: RecentSeconds | None
    """Seconds from the pulse of a window's last frame to the window's solution."""
    optimal: float | None
    """Share of the windows whose solution is proven optimal."""
    solved_windows: int
    """The number of windows behind ``optimal``."""
    floor_offset: float | None
    """Meters by which it disagrees with the others about where people stand, and is corrected; null: tracked
    alone."""
    last_error: CameraProblem | None
    """The last problem; it stays when the camera has recovered."""
    picture: ImagePlacement | None
    """Null: unknown."""


class FloorCamera(msgspec.Struct, frozen=True):
    """One camera's coverage of the common floor."""

    camera: str
    homography: list[list[float]]
    """3x3, from pixels of the site's image to the floor; a third coordinate below 0: above the horizon."""
    outline: list[list[float]]
    """Corners, x and y on the floor; empty: it sees no floor."""


class Floor(msgspec.Struct, frozen=True):
    """The floor plan."""

    cameras: list[FloorCamera]
    """Calibrated cameras whose image size is known."""
    uncalibrated: list[str]


class CameraService:
    """Queries about cameras."""

    def __init__(self, pipeline: BestViewPipeline) -> None:
        self._pipeline = pipeline

    @property
    def ids(self) -> list[str]:
        """The cameras' ids, in the order of the configuration."""
        return list(self._pipeline.frame_buffers)

    def require(self, camera: str) -> None:
        """Check that a camera exists.

        Raises:
            UnknownCameraError: it does not.
        """
        if camera not in self._pipeline.frame_buffers:
            raise UnknownCameraError(camera, self._pipeline.frame_buffers)

    def server_of(self, camera: str) -> str | None:
        """Return the address of the service in whose area a camera is that this one does not take in."""
        sharding = self._pipeline.config.view.sharding
        if camera in self._pipeline.frame_buffers:
            return None
        areas = [number for number, area in enumerate(sharding.areas) if camera in area.cameras]
        return shard_address(areas[0], sharding) if areas else None

    def list_cameras(self) -> list[CameraInfo]:
        """Return each camera's state, as far as any viewer may know it."""
        return [self._info(camera, state) for camera, state in self._pipeline.ingest.states.items()]

    def diagnose_cameras(self) -> list[CameraDiagnostics]:
        """Return each camera's diagnostics, for the operator."""
        return [self._diagnostics(camera, state) for camera, state in self._pipeline.ingest.states.items()]

    def map_floor(self) -> Floor:
        """Return each calibrated camera's coverage of the floor."""
        config = self._pipeline.config
        cameras = []
        for camera in config.cameras:
            size = self._pipeline.ingest.states[camera.id].metrics.size
            if camera.ground is not None and size is not None:
                ground = np.array(camera.ground, dtype=np.float64)
                site = (config.site.width, config.site.height)
                coverage = floor_coverage(ground, size, site)
                status = self._pipeline.ingest.states[camera.id].status
                motion = status.motion if status else None
                homography = moved_homography(coverage.site_homography, motion)
                cameras.append(FloorCamera(camera.id, homography.tolist(), coverage.outline.tolist()))
        return Floor(cameras, [camera.id for camera in config.cameras if camera.ground is None])

    def _info(self, camera: str, state: CameraState) -> CameraInfo:
        status, unavailable = state.status, state.unavailable
        return CameraInfo(
            camera=camera,
            state=state.label,
            pulse=self._pipeline.frame_buffers[camera].newest,
            late=self._pipeline.aligner.late_messages[camera],
            fps=status.fps if status else 0.0,
            missed=status.missed if status else 0,
            shed=status.shed if status else 0,
            load_level=status.load_level if status else 0,
            synchronized=status.synchronized if status else False,
            message=state.message,
            retry_at=unavailable.retry_at if unavailable and unavailable.retry_s else None,
            condition=status.condition if status else "clear",
            condition_since=(status.condition_since or None) if status else None,
            covered_share=status.covered_share if status else 0.0,
        )

    def _diagnostics(self, camera: str, state: CameraState) -> CameraDiagnostics:
        status, metrics = state.status, state.metrics
        info = msgspec.structs.asdict(self._info(camera, state))
        return CameraDiagnostics(
            **{**info, "message": state.operator_message},
            bad_messages=state.bad_messages,
            clock_offset=status.clock_offset if status else None,
            sync_error=metrics.sync_error,
            tracking_delay=metrics.tracking_delay,
            optimal=metrics.optimal,
            solved_windows=metrics.recent_solved_windows,
            floor_offset=self._pipeline.joint.offsets.get(camera),
            last_error=metrics.last_error,
            picture=None if metrics.size is None else self._placement(metrics.size),
        )

    def _placement(self, size: tuple[int, int]) -> ImagePlacement:
        site = self._pipeline.config.site
        letterbox = Letterbox(size, (site.width, site.height))
        left, top = letterbox.camera_to_site(np.zeros(2)).tolist()
        return ImagePlacement(width=size[0], height=size[1], scale=letterbox.scale, left=left, top=top)
