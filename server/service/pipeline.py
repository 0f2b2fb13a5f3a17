"""The best-view pipeline: aligns the cameras' messages, selects views, splices and records streams."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from logthrottle import LogThrottle
from server.config.sections import ViewSettings
from server.config.site_config import Config
from server.media.codec import stream_format_for
from server.messaging.inbox import Message
from server.messaging.messages import GopChoices
from server.service.buffer_lengths import BufferLengths
from server.service.bus_connection import BusConnection
from server.service.calibration.walk_session import WalkSession
from server.service.decision_files.live_decision_writer import LiveDecisionWriter, open_decision_files
from server.service.decision_state import DecisionState
from server.service.deletion.recording_deletion import RecordingDeletion
from server.service.identity.service_area import ingest_area
from server.service.identity.state_replication import SNAPSHOT_WAIT_S, StateReplication
from server.service.ingest.backlog import BacklogMonitor
from server.service.ingest.epoch_aligner import Epoch, EpochAligner
from server.service.ingest.ingest import Ingest
from server.service.ingest.loss_recorder import LossRecorder
from server.service.joint_tracking.worker import JointWorker
from server.service.metrics.delay_meter import DelayMeter
from server.service.metrics.stage_timers import StageTimers
from server.service.mode_publisher import ModePublisher
from server.service.operator_assist.operator_assist import OperatorAssist
from server.service.other_sites.other_sites import OtherSites
from server.service.pulse_follower import PulseFollower
from server.service.recording.recorder import Recorder
from server.service.replication.service_replication import ServiceReplication
from server.service.rules.engine import RuleEngine, SiteEvent
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.splicer import Splicer
from server.service.view_selection.decider import GopDecision, ViewDecider, camera_homographies
from server.service.view_selection.delay_modes import ModeDecision
from server.system.errors import UserError

log = logging.getLogger(__name__)

_INBOX_TURNS = 10
"""How often the inboxes are served between two epochs, at most."""
_FIRST_PULSE_S = 3.0
"""How long to wait for the first pulse: without a pulse server, cameras count by themselves."""


class BestViewPipeline:
    """The best-view process without HTTP. ``out`` is a folder for tracks and choices."""

    def __init__(self, config: Config, out: Path | None = None) -> None:
        self.config = config
        self.pulses = PulseFollower(config)
        cameras = config.camera_ids
        fps, stride, lengths = config.site.fps, config.window.stride, BufferLengths.of(config)
        self.max_lookahead = lengths.max_lookahead
        self.stream_format = stream_format_for(
            config.encode.codec, config.site.size, per_camera_parameters=config.encode.parameters == "own"
        )
        self.frame_buffers = {
            camera: FrameBuffer(fps, lengths.frames, self.stream_format) for camera in cameras
        }
        latest = lengths.max_ahead + lengths.grace + lengths.backlog
        self.aligner = EpochAligner(cameras, stride, lengths.grace, lengths.backlog, latest)
        audio_format = config.sound.format
        self.audio_buffer = (
            None if audio_format is None else AudioBuffer(audio_format, fps, lengths.frames / fps)
        )
        self._backlog_monitor = BacklogMonitor(lengths.frames - config.lookahead - config.gop)
        self.skipped_epochs = 0
        """Epochs that were not decided because decisions had fallen too far behind."""
        self._skip_log = LogThrottle()
        self.splicer = Splicer(self.frame_buffers, self.stream_format, config, self.audio_buffer)
        meter = DelayMeter(self.pulses.seconds_since, self.frame_buffers.values(), fps)
        self.mode_publisher = ModePublisher(self.splicer, meter)
        self.bus = BusConnection(config)
        self.ingest = Ingest(
            self.frame_buffers,
            self.aligner,
            self.mode_publisher.publish_frame,
            self.audio_buffer,
            audio_sender=config.audio_sender,
            current_pulse=lambda: self.pulses.newest,
            max_ahead=lengths.max_ahead,
            on_ended=self.bus.confirm_end,
        )
        self.decider = ViewDecider(
            config, camera_homographies(config), lambda camera, pulse: self.frame_buffers[camera].has(pulse)
        )
        self._area = ingest_area(config, camera_homographies(config))
        self.joint = JointWorker(config)
        self.decision_state = DecisionState(fps)
        people = self.decider.people
        self.assist = OperatorAssist(config, people, partial(self.bus.send_to_camera, "position_corrections"))
        self.recorder = Recorder(
            config, self.frame_buffers, self.stream_format, lengths.frames, self.audio_buffer
        )
        self.recording_deletion = RecordingDeletion(self.recorder)
        self.state_replication = StateReplication(
            people,
            cameras,
            fps,
            partial(self.bus.send_to_camera, "identities"),
            sends=lambda: self.replication.leads,
            send_to=config.view.sharding.keepers,
            deleted=self.recording_deletion.forgotten,
        )
        self.replication = ServiceReplication(config, people, self.state_replication, self.bus)
        self.other_sites = OtherSites(
            config, people, self.state_replication, self.replication, self.bus, self.pulses
        )
        self.walk_session = WalkSession(config)
        self._last_decided = -1
        """The last pulse of the last epoch; later frames have no tracks."""
        self.loss_recorder = LossRecorder(self.frame_buffers, self.ingest.states, stride)
        self.stage_timers = StageTimers()
        self.rules = RuleEngine(config, self.decider.people.letterboxes)
        self.on_decision: list[Callable[[GopChoices], None]] = []
        self.on_event: list[Callable[[SiteEvent], None]] = []
        self.on_config: list[Callable[[], None]] = []
        """Called after a changed configuration has been applied."""
        self._out = out
        self.decision_writer: LiveDecisionWriter | None = None
        """Writes files of decisions, once the pipeline runs; None: there are none."""
        self._changed = asyncio.Event()
        self._runs_without_pulses = False
        """Whether waiting for the first pulse has timed out."""

    def open_bus(self) -> None:
        """Open the bus that the cameras connect to.

        Raises:
            UserError: its address is in use, or a password file cannot be read.
        """
        self.pulses.load_credentials()
        own = {"tracks": self._tracks, "retained_identities": self._retained_identities}
        on_audio = None if self.audio_buffer is None else self.ingest.receive_audio
        self.bus.open({**self.ingest.handlers, **own}, on_audio, self._alive)

    async def run(self) -> None:
        """Serve until every camera's recording has ended.

        Raises:
            UserError: the output folder cannot be written.
        """
        if self._out is not None:  # once all ports are open: a failed start leaves no files
            self.decision_writer = self.loss_recorder.decision_writer = open_decision_files(
                self._out, self.config.camera_ids, self.decider.people.letterboxes
            )
        await self.joint.start()
        self.recorder.open()
        for deleted in await self.recording_deletion.read_journal():
            self.replication.add_deletion(deleted)
        await self.replication.take_over()
        await self.other_sites.open()
        first_pulse_timeout = asyncio.get_running_loop().call_later(_FIRST_PULSE_S, self._run_without_pulses)
        follow = asyncio.create_task(self.pulses.follow(self._changed.set), name="pulses")
        follow.add_done_callback(lambda _: self._changed.set())
        completing = asyncio.create_task(self.recording_deletion.complete_interrupted(), name="deletion")
        try:
            while not self.aligner.all_ended_and_decided:
                await self._changed.wait()
                self._changed.clear()
                if follow.done():
                    await follow  # raises its error
                may_decide = self.pulses.newest >= 0 or self._runs_without_pulses
                if may_decide and not self.state_replication.is_waiting:
                    await self.decide_or_skip()
            for decision in self.finish():
                self._publish(decision)
            self._publish_modes(self.decider.modes.take(), live=False)
            log.info("every camera's recording has ended")
        finally:
            first_pulse_timeout.cancel()
            follow.cancel()
            completing.cancel()  # the next start completes it
            await asyncio.gather(follow, completing, return_exceptions=True)
            await self.joint.close()

    def finish(self) -> list[GopDecision]:
        """Decide the remaining GOPs after the end of every recording."""
        newest = max(frame_buffer.newest for frame_buffer in self.frame_buffers.values())
        return self.decider.finish(min(newest, self._last_decided))

    def _run_without_pulses(self) -> None:
        self._runs_without_pulses = True
        self._changed.set()

    def decide(self) -> None:
        """Decide and publish all epochs that are ready, where no cameras are tracked jointly."""
        while (epoch := self._next_epoch()) is not None:
            self.state_replication.begin(epoch.last)
            with self.stage_timers.deciding():
                decisions = self.decider.step(epoch)
            self._finish_epoch(epoch, decisions)

    async def decide_or_skip(self) -> None:
        """Decide and publish the epochs that are ready, or skip those that would be decided too late.

        Inboxes and tasks are served between two epochs: on an overloaded machine another epoch may always be
        ready. Frames are received first: a lost frame cannot be shown.
        """
        while (epoch := self._next_epoch()) is not None:
            if self.config.joint_cameras:
                with self.stage_timers.tracking():
                    epoch = await self.joint.step(epoch)
            self.state_replication.begin(epoch.last)
            with self.stage_timers.deciding():
                await self.decider.people.associate(epoch)
                decisions = self.decider.step(epoch)
            self._finish_epoch(epoch, decisions)
            await asyncio.sleep(0)
            for _ in range(_INBOX_TURNS):
                if not self.bus.has_waiting_messages:
                    break
                await asyncio.sleep(0)
            self._skip_backlog()

    def _skip_backlog(self) -> None:
        """Skip to the present where decisions do not catch up and their frames are no longer buffered."""
        backlog = self.aligner.backlog(self.pulses.newest)
        if not self._backlog_monitor.is_lost(backlog):
            return
        self.skipped_epochs += self.aligner.skip_to(self.pulses.newest)
        if (more := self._skip_log.record()) is not None:
            text = "decisions are %.1f s behind and do not catch up%s: skipping to the present"
            log.warning(text, backlog / self.config.site.fps, more)

    def _next_epoch(self) -> Epoch | None:
        epoch = self.aligner.take_next_ready(self.pulses.newest)
        return epoch if epoch is None or self._area is None else self._area.without_far_people(epoch)

    def apply_live_view_settings(self, view: ViewSettings) -> None:
        """Select views by other settings from the next GOP on, as far as they can change at run time.

        Raises:
            UserError: the look-ahead is too short, or longer than the frame buffers allow.
        """
        try:
            self.config.check_lookahead(view)
        except ValueError as error:
            raise UserError(str(error)) from error
        if self.config.lookahead_of(view) > self.max_lookahead:
            most = self.max_lookahead / self.config.site.fps
            raise UserError(
                f"view.lookahead_s: is {view.lookahead_s:g} s but can be at most {most:g} while "
                "the service runs (frame buffers); set a longer view.buffer_s and restart for more"
            )
        self.decider.apply_live_view_settings(view)

    def apply_config(self, config: Config) -> None:
        """Apply a configuration that differs only in what can change at run time, or in the cameras' part.

        View settings that were changed at run time are replaced if those of the configuration have changed.

        Raises:
            UserError: the look-ahead is too short, or longer than the frame buffers allow.
        """
        if config.view != self.config.view:
            self.apply_live_view_settings(config.view)
        # The ground of synthetic cameras is in no file.
        ground = {camera.id: {"ground": camera.ground} for camera in self.config.cameras}
        cameras = [camera.model_copy(update=ground[camera.id]) for camera in config.cameras]
        before, self.config = self.config, config.model_copy(update={"cameras": cameras})
        if any(getattr(config, name) != getattr(before, name) for name in ("zones", "rules", "site")):
            self.rules.apply(self.config)
        for callback in self.on_config:
            callback()

    def close(self) -> None:
        """End all streams, and close the bus and the files."""
        with contextlib.ExitStack() as closing:  # all of them, even if one raises; in reverse order
            closing.callback(self.bus.close)
            if self.decision_writer is not None:
                closing.callback(self.decision_writer.close)
            closing.callback(self.recorder.close)
            closing.callback(self.splicer.close)

    def _tracks(self, message: Message) -> None:
        self.ingest.receive_tracks(message)
        self._changed.set()

    def _alive(self, key: str, is_present: bool) -> None:
        self.ingest.set_present(key, is_present)
        self.state_replication.set_present(key, is_present)
        self._changed.set()
        if self.state_replication.is_waiting:
            asyncio.get_running_loop().call_later(SNAPSHOT_WAIT_S, self._changed.set)

    def _retained_identities(self, message: Message) -> None:
        self.ingest.receive_retained_identities(message, self.state_replication.receive_snapshot)
        self._changed.set()

    def _finish_epoch(self, epoch: Epoch, decisions: Sequence[GopDecision]) -> None:
        self._last_decided = epoch.last
        self.loss_recorder.record_epoch(epoch)
        self.walk_session.add(epoch)
        self.state_replication.advance(epoch.last)  # before publishing, so that names are restored
        self.replication.step(epoch)
        self.other_sites.step()
        others = self.decider.modes.take()
        self._publish_modes(others, live=True)
        for decision in decisions:
            self._publish(decision)
        self._publish_modes(others, live=False)
        self.assist.step(epoch, self.config)

    def _publish_modes(self, decisions: Sequence[ModeDecision], *, live: bool) -> None:
        merged = self.decider.people.registry.merged
        self.mode_publisher.publish(decisions, merged, self.decision_writer, live=live)

    def _publish(self, decision: GopDecision) -> None:
        """Publish a GOP's choices, then its frames."""
        with self.stage_timers.sending(lambda: self.pulses.seconds_since(decision.first)):
            self._send(decision)

    def _send(self, decision: GopDecision) -> None:
        choices = self.decision_state.put(decision)
        self.mode_publisher.record_balanced(choices)
        self.recorder.put(choices, self.pulses.pulse0, self.state_replication.numbers_since)
        for callback in self.on_decision:
            callback(choices)
        events = self._evaluate_rules(decision)
        self.splicer.publish_decision(decision)
        self.splicer.forget(self.decider.people.known, decision.merged)
        self.bus.publish_choices(choices)
        if self.decision_writer is not None:
            self.decision_writer.set_numbers_since(self.state_replication.numbers_since)
            self.decision_writer.write_or_skip(decision, events)
        self.loss_recorder.record_gop(decision)
        self.ingest.forget_thumbnails_before(decision.first - self.decider.people.forget_after)

    def _evaluate_rules(self, decision: GopDecision) -> list[SiteEvent]:
        """Evaluate the rules and publish events; of several services with the same people one does."""
        if not self.config.view.sharding.is_first:
            return []
        events = self.rules.put(decision, self.decider.people.registry.names, self.pulses.pulse0)
        for event in events:
            for callback in self.on_event:
                callback(event)
        return events
