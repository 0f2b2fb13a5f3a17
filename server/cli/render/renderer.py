"""``myview render``: writes the best view of each person in recorded views."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from server.cli.render.camera_workers import CameraWorkers, EpochBatch
from server.cli.render.films import FilmWriter
from server.cli.render.plots import plot_choices, plot_tracks
from server.cli.render.site_file import write_site
from server.cli.render.soundtrack import Soundtrack
from server.cli.render.video_info import Size
from server.config.site_config import Config
from server.media.codec import stream_format_for
from server.service.decision_files.decision_writer import DecisionWriter
from server.service.ingest.epoch_aligner import EpochAligner
from server.service.joint_tracking.stage import JointStage
from server.service.rules.engine import RuleEngine
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.view_selection.decider import GopDecision, ViewDecider, camera_homographies

log = logging.getLogger(__name__)

_BOOT = 0


@dataclass(frozen=True, slots=True)
class RenderedPeople:
    """The people of a rendering."""

    numbers: list[int]
    """Of all people who have a film."""
    corrected: dict[int, int]
    """Numbers that turned out to be another person's, with that person's number."""


class Renderer:
    """Decides and splices recordings with the classes of the live system, and writes the results.

    ``begins`` is when they begin, unix seconds; None: unknown.
    """

    def __init__(self, config: Config, folder: Path, begins: float | None = None) -> None:
        cameras = config.camera_ids
        self._config, self._folder = config, folder
        # Undecided frames, and frames by which a camera is ahead.
        frames = 4 * (config.lookahead + config.gop + config.window.stride)
        stream_format = stream_format_for(
            config.encode.codec, config.site.size, per_camera_parameters=config.encode.parameters == "own"
        )
        self._frame_buffers = {
            camera: FrameBuffer(config.site.fps, frames, stream_format) for camera in cameras
        }
        self._aligner = EpochAligner(cameras, config.window.stride, grace=0)
        for camera in cameras:
            self._aligner.camera_connected(camera)
        self._decider = ViewDecider(
            config, camera_homographies(config), lambda camera, pulse: self._frame_buffers[camera].has(pulse)
        )
        self._joint = JointStage(config)
        self._recorder = DecisionWriter(folder, cameras, self._decider.people.letterboxes)
        self._rules = RuleEngine(config, self._decider.people.letterboxes)
        self._begins = begins
        self._soundtrack = Soundtrack(config)
        audio_buffer = self._soundtrack.audio_buffer
        self._films = FilmWriter(
            folder / "best", self._frame_buffers, stream_format, config.site, audio_buffer
        )
        self._sizes: dict[str, Size] = {}
        self.ended: dict[str, int] = {}
        """The last pulse of each camera whose recording is over."""
        self.frames = 0

    def take(self, batch: EpochBatch) -> None:
        """Add a camera's batch, and decide the GOPs that are complete."""
        for unit in batch.units:
            self._frame_buffers[batch.camera].put(unit.pulse, _BOOT, unit.data, key=unit.key)
            self._aligner.frame_received(batch.camera, _BOOT, unit.pulse)
            self.frames += 1
        if batch.tracks is not None:
            self._aligner.add_tracks(batch.tracks)
            self._sizes[batch.camera] = batch.tracks.size
            if batch.ended:
                self.ended[batch.camera] = batch.tracks.last
        for epoch in self._aligner.take_ready(now=-1):
            for decision in self._decider.step(self._joint.step(epoch)):
                self._write(decision)
            self._write_views()

    def finish(self) -> RenderedPeople:
        """Decide and write the remaining GOPs; return all people."""
        for decision in self._decider.finish(max(self.ended.values())):
            self._write(decision)
        self._write_views()
        self.close()
        write_site(self._folder, self._config, self._sizes)
        plot_choices(self._folder / "choices.csv", self._config.camera_ids, self._folder / "choices.png")
        for camera in self._config.camera_ids:
            plot_tracks(self._folder / "tracks" / f"{camera}.txt", self._folder / "tracks" / f"{camera}.png")
        return RenderedPeople(self._films.numbers, self._films.corrected)

    def close(self) -> None:
        """Close all files; :meth:`finish` does it, too."""
        self._recorder.close()
        self._films.close()

    def _write_views(self) -> None:
        for decision in self._decider.modes.take():
            self._recorder.write_views(decision)

    def _write(self, decision: GopDecision) -> None:
        self._recorder.write(decision, self._rules.put(decision, {}, self._begins))
        self._soundtrack.read(decision.first, decision.first + decision.frames)
        self._films.write(decision)


def render(
    config: Config, folder: Path, progress: Callable[[int], None], begins: float | None = None
) -> RenderedPeople:
    """Render into an existing folder; ``progress`` is called with the frames done in all cameras.

    ``begins`` is when the recordings begin, unix seconds, for rules with a schedule; None: unknown.

    Raises:
        UserError: a recording cannot be read.
    """
    if begins is None and (unused := [rule.id for rule in config.rules if rule.has_schedule]):
        log.warning("rules with a schedule do not apply without --begins: %s", ", ".join(unused))
    renderer = Renderer(config, folder, begins)
    workers = CameraWorkers(config)
    try:
        workers.start()
        for batch in workers:
            renderer.take(batch)
            progress(renderer.frames)
        _warn_if_unequal({camera: renderer.ended[camera] for camera in config.camera_ids})
        return renderer.finish()
    finally:
        workers.close()
        renderer.close()


def _warn_if_unequal(ended: dict[str, int]) -> None:
    """Log a warning if the recordings differ in length."""
    if len(set(ended.values())) > 1:
        lengths = ", ".join(f"{camera} with frame {last + 1}" for camera, last in ended.items())
        log.warning("the views are of different length: %s; the shorter ones end first", lengths)
