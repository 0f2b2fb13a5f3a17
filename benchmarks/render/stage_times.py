"""The classes of `myview render` in one process, timed by stage."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from benchmarks.common.recorded_views import RecordedViews
from benchmarks.common.stopwatch import Stopwatch
from server.camera.peers.cross_view_scorer import CrossViewScorer
from server.camera.pipeline import CameraPipeline
from server.cli.generated_config import config_for_videos
from server.cli.render.camera_workers import run_cameras
from server.cli.render.renderer import Renderer
from server.config.loader import read_content
from server.config.site_config import Config
from server.service.ingest.epoch_aligner import EpochAligner
from server.service.view_selection.decider import ViewDecider
from tracking import OnlineTracker, create_solver
from tracking.detectors import BackgroundDetector

STAGES = {
    "decode": "the recording's H.264 to a picture of the site's size",
    "encode": "the picture to H.264, once",
    "detect": "background, box filters, histograms",
    "rescore": "rescoring by the detections of other cameras",
    "track": "networks, initiation, templates",
    "solve": "the network programs",
    "publish": "tracks to messages",
    "decide": "identities, and the view of each person",
    "write": "alignment, fragments, films, tracks, choices",
}


@dataclass(frozen=True, slots=True)
class RenderStageTimes:
    """Processor milliseconds per frame (one camera's picture) of each stage."""

    ms: dict[str, float]


def time_stages(views: RecordedViews, config_path: Path, folder: Path) -> RenderStageTimes:
    """Render the views in this process into a new folder; return each stage's time per frame."""
    config = config_for_videos(
        views.videos, base=read_content(config_path), folder=config_path.parent, ground=views.ground
    )
    folder.mkdir()
    watch = Stopwatch()
    with watch.watching(
        (CameraPipeline, "take", "decode"),
        (CameraPipeline, "encode", "encode"),
        (BackgroundDetector, "detect", "detect"),
        (CrossViewScorer, "build_message", "rescore"),
        (CrossViewScorer, "rescore", "rescore"),
        (OnlineTracker, "push", "track"),
        (OnlineTracker, "flush", "track"),
        (type(create_solver(config.track.solver)), "solve", "solve"),
        (CameraPipeline, "track_detections", "publish"),
        (CameraPipeline, "finish", "publish"),
        (ViewDecider, "step", "decide"),
        (ViewDecider, "finish", "decide"),
        (EpochAligner, "take_ready", "write"),
        (Renderer, "take", "write"),
    ):
        frames = _render(config, folder)
    return RenderStageTimes({stage: 1e3 * watch.seconds[stage] / frames for stage in STAGES})


def _render(config: Config, folder: Path) -> int:
    """Render as the command does, without worker processes; return the number of frames."""
    renderer = Renderer(config, folder)
    pipelines = {camera: CameraPipeline(config, camera) for camera in config.camera_ids}
    try:
        for batch in run_cameras(pipelines):
            renderer.take(batch)
        renderer.finish()
    finally:
        renderer.close()
    return renderer.frames
