"""Probe of one camera: opens its source and runs some frames through the live pipeline."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

from server.camera.pipeline import CameraPipeline
from server.camera.sources import SourceEndedError
from server.cli.doctor.stream_probe import StreamStats, file_fps, measure_stream
from server.cli.doctor.substream import SubstreamProbe, probe_substream
from server.config.camera_password import fill_in_password
from server.config.site_config import Config
from server.config.source_address import SourceKind, source_kind
from server.system.errors import UserError

_FRAMES_S = 3.0
"""Longest run, in seconds of frames."""


@dataclass(frozen=True, slots=True)
class CameraProbe:
    """The result of a probe.

    Attributes:
        problem: why the camera cannot run; empty if it can.
        sent: statistics of a network camera's stream; None for other sources.
        size: width and height of its pictures.
        recorded_fps: stated frame rate of a video file; None for other sources.
        passes: whether its H.264 is passed through.
        why_encoded: why it is not, if pass-through is configured.
        frames: the number of frames run.
        kbps: bit rate of the site's stream.
        cores: processor cores that the camera needs at the site's rate.
        substream: the result for its substream; None: it has none.
    """

    problem: str = ""
    sent: StreamStats | None = None
    size: tuple[int, int] | None = None
    recorded_fps: float | None = None
    passes: bool = False
    why_encoded: str = ""
    frames: int = 0
    kbps: float = 0.0
    cores: float = 0.0
    substream: SubstreamProbe | None = None


def probe_camera(config: Config, camera_id: str, seconds: float) -> CameraProbe:
    """Probe a camera for ``seconds`` once it has answered."""
    sent = None
    try:
        config = fill_in_password(config, camera_id)
        camera = config.camera(camera_id)
        kind = source_kind(camera.source)
        if kind is SourceKind.STREAM:
            sent = measure_stream(camera.source, camera.options, seconds / 2, seconds)
        substream = probe_substream(camera, sent, seconds / 4, seconds)
        pipeline = CameraPipeline(config, camera_id)
    except UserError as error:
        return CameraProbe(str(error).removeprefix(f"camera {camera_id}: "), sent)
    try:
        probe = _run_frames(config, pipeline, sent, substream, time.monotonic() + seconds / 2)
        recorded_fps = file_fps(camera.source) if kind is SourceKind.FILE else None
        return replace(probe, recorded_fps=recorded_fps, substream=substream)
    finally:
        pipeline.close()


def _run_frames(
    config: Config,
    pipeline: CameraPipeline,
    sent: StreamStats | None,
    substream: SubstreamProbe | None,
    until: float,
) -> CameraProbe:
    fps, size = config.site.fps, pipeline.source.size
    live = not pipeline.source.recorded
    frames = units = 0
    began = time.thread_time()
    for pulse in range(pipeline.first_pulse, pipeline.first_pulse + max(1, round(_FRAMES_S * fps))):
        try:
            frame = pipeline.take(pulse)
        except SourceEndedError:
            break
        if frame is not None:
            frames, units = frames + 1, units + len(pipeline.encode(pulse, frame).data)
            pipeline.track(pulse, frame)
        if time.monotonic() >= until:
            break
        if live:
            time.sleep(1 / fps)
    cpu_s = time.thread_time() - began
    decoding = sent.cpu_s_per_picture if sent is not None else 0.0
    if sent is not None and substream is not None and substream.substream is not None:
        decoding = substream.substream.cpu_s_per_picture + (0.0 if pipeline.is_passthrough else decoding)
    per_frame = 1 / max(1, frames)
    return CameraProbe(
        problem="" if frames else "no picture arrived in time",
        sent=sent,
        size=size,
        passes=pipeline.is_passthrough,
        why_encoded=pipeline.why_encoded,
        frames=frames,
        kbps=8 * units * per_frame * fps / 1000,
        cores=(cpu_s * per_frame + decoding) * fps,
    )
