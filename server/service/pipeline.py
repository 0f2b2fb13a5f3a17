"""The best-view service: takes in what the cameras send, decides, splices."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import ssl
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import msgspec

from camsync import Credentials, PulseClient
from logthrottle import LogThrottle
from server.config.pulse_access import bestview_client_name, pulse_client_tls, pulse_credentials
from server.config.sections import ViewSettings
from server.config.site_config import Config
from server.media.codec import stream_format_for
from server.messaging.bus import Bus
from server.messaging.bus_access import access_control_of
from server.messaging.inbox import Inbox, Message
from server.messaging.messages import GopChoices, ZenohKeys
from server.service.calibration.walk_session import WalkSession
from server.service.decision_files.live_decision_writer import LiveDecisionWriter
from server.service.decision_state import Board
from server.service.identity.state_replication import PATIENCE_S, StateReplication
from server.service.ingest.backlog import BacklogMonitor
from server.service.ingest.epoch_aligner import Epoch, EpochAligner
from server.service.ingest.ingest import Ingest
from server.service.ingest.loss_recorder import LossRecorder
from server.service.metrics.stage_timers import StageTimers
from server.service.operator_assist.operator_assist import OperatorAssist
from server.service.recording.recorder import Recorder
from server.service.streaming.audio_buffer import AudioBuffer
from server.service.streaming.frame_buffer import FrameBuffer
from server.service.streaming.splicer import Splicer
from server.service.view_selection.decider import GopDecision, ViewDecider, camera_homographies
from server.system.errors import UserError

log = logging.getLogger(__name__)

_FAR_S = 60.0
"""How far a camera may have counted ahead of this service, which may have been held up; or this service be
behind the pulses, and still go through all that it has missed."""
_TURNS = 10
"""How often, between two epochs, all inboxes have their turn, as long as something waits in them."""
_FIRST_PULSE_S = 3.0
"""How long the first pulse is waited for: where there is no pulse server, cameras count alone."""


class BestViewPipeline:
    """Everything of the best-view process but HTTP. ``out`` is a folder for tracks and choices."""

    def __init__(self, config: Config, out: Path | None = None) -> None:
        self.config = config
        cameras = config.camera_ids
        fps, stride = config.site.fps, config.track.window.stride
        grace, behind = round(config.view.late_after_s * fps), round(config.track.backlog_s * fps)
        # What is waited for must still be there when it is decided.
        frames = max(round(config.view.buffer_s * fps), behind + 4 * (config.view.lookahead + grace + stride))
        self.most_lookahead = (frames - behind) // 2 - grace - stride
        """Frames that can be looked ahead while this runs: half as many as what is kept could do for."""
        self.agreement = stream_format_for(
            config.encode.codec, config.site.size, own_parameters=config.encode.parameters == "own"
        )
        self.frame_buffers = {
            camera: FrameBuffer(config.site.fps, frames, self.agreement) for camera in cameras
        }
        far = round(_FAR_S * fps)
        self.aligner = EpochAligner(cameras, stride, grace, behind, far + grace + behind)
        form = config.sound.format
        self.sound = None if form is None else AudioBuffer(form, config.site.fps, frames / config.site.fps)
        self._keeping_up = BacklogMonitor(frames - config.view.lookahead - config.encode.gop)
        self.left_out = 0
        """Epochs that were not decided, since there was more to decide than could be."""
        self._leaving_out = LogThrottle()
        self.splicer = Splicer(self.frame_buffers, self.agreement, config, self.sound)
        self.intake = Ingest(
            self.frame_buffers,
            self.aligner,
            self.splicer.publish_frame,
            self.sound,
            sounding=config.sounding,
            now=lambda: self.pulse,
            ahead=far,
        )
        self.decider = ViewDecider(
            config, camera_homographies(config), lambda camera, pulse: self.frame_buffers[camera].has(pulse)
        )
        self.board = Board(config.site.fps)
        self.assist = OperatorAssist(
            config, self.decider.people, partial(self._tell_camera, "operator_points")
        )
        self.state_replication = StateReplication(
            self.decider.people,
            cameras,
            fps,
            partial(self._tell_camera, "identities"),
            sends=config.view.share.index == 0,
        )
        self.walking = WalkSession(config)
        self.past = Recorder(config, self.frame_buffers, self.agreement, frames, self.sound)
        self.pulse = -1
        self._decided_to = -1
        """The last pulse of the last epoch; a frame that is said to be of a later one shows nobody."""
        self.pulse0: float | None = None
        """When pulse 0 was due, unix seconds; None before the first pulse."""
        self._pulsed_at: float | None = None
        self._clock: Callable[[], float] = time.time
        """The pulses', which does not step when the system's is set."""
        self.losses = LossRecorder(self.frame_buffers, self.intake.states, stride)
        self.stages = StageTimers()
        self.inboxes: list[Inbox[Message]] = []
        """Where the bus's messages wait for the event loop."""
        self.on_decision: list[Callable[[GopChoices], None]] = []
        self._out = out
        self._recorder: LiveDecisionWriter | None = None
        self._bus: Bus | None = None
        self.pulse_credentials: Credentials | None = None
        self.pulse_tls: ssl.SSLContext | None = None
        self._keys = ZenohKeys(config.site.name)
        self._changed = asyncio.Event()
        self._without_pulses = False
        """Whether the first pulse is not waited for any more."""

    def open(self) -> None:
        """Open the bus, which the cameras connect to; of several services the first one's.

        Raises:
            UserError: its address is in use, or a file of passwords cannot be read.
        """
        index, zenoh = self.config.view.share.index, self.config.zenoh
        self.pulse_credentials = pulse_credentials(self.config, bestview_client_name(index))
        self.pulse_tls = pulse_client_tls(self.config)
        if index:
            self._bus = bus = Bus.second(zenoh, bestview_client_name(index))
        else:
            self._bus = bus = Bus.router(zenoh, access_control_of(self.config))
        handlers = {
            "video": self.intake.video,
            "tracks": self._tracks,
            "status": self.intake.status,
            "thumbs/*": self.intake.thumbnail,
            "retained_identities": self._remembered,
        }
        for what, handler in handlers.items():
            self.inboxes.append(bus.subscribe(self._keys.camera("*", what), handler))
        if self.sound is not None:
            self.inboxes.append(bus.subscribe(self._keys.sound, self.intake.sound))
        bus.watch_alive(self._keys.camera("*", "alive"), self._alive)
        bus.declare_alive(self._keys.bestview("alive", index))

    async def run(self) -> None:
        """Serve until every camera's recording is over.

        Raises:
            UserError: the output folder cannot be written.
        """
        if self._out is not None:  # not before all ports are listened on: a failed start leaves no files
            self._recorder = self.losses.recorder = self._record(self._out)
        self.past.open()
        patience = asyncio.get_running_loop().call_later(_FIRST_PULSE_S, self._go_without_pulses)
        follow = asyncio.create_task(self._follow_pulses(), name="pulses")
        follow.add_done_callback(lambda _: self._changed.set())
        try:
            while not self.aligner.all_ended:
                await self._changed.wait()
                self._changed.clear()
                if follow.done():
                    await follow  # raises what ended it
                if (self.pulse >= 0 or self._without_pulses) and not self.state_replication.is_waiting:
                    await self.decide_by_turns()
            for decision in self.what_is_left():
                self._publish(decision)
            log.info("every camera's recording is over")
        finally:
            patience.cancel()
            follow.cancel()
            await asyncio.gather(follow, return_exceptions=True)

    def what_is_left(self) -> list[GopDecision]:
        """Decide what is left when every recording is over."""
        newest = max(frame_buffer.newest for frame_buffer in self.frame_buffers.values())
        return self.decider.finish(min(newest, self._decided_to))

    def _go_without_pulses(self) -> None:
        self._without_pulses = True
        self._changed.set()

    def decide(self) -> None:
        """Decide and publish whatever can be decided by now."""
        while self._decide_next():
            pass

    async def decide_by_turns(self) -> None:
        """Do the same, and let viewers, cameras and signals have their turn between two epochs.

        On a machine with too much to do there may always be one more. What has come by then is taken in
        first: pictures that are lost cannot be shown however well they are chosen. What would be decided too
        late to be shown is left out.
        """
        while self._decide_next():
            await asyncio.sleep(0)
            for _ in range(_TURNS):
                if not any(inbox.waiting for inbox in self.inboxes):
                    break
                await asyncio.sleep(0)
            self._keep_up()

    def _keep_up(self) -> None:
        """Go on with the present where decisions are of pictures that are gone, and do not catch up."""
        behind = self.aligner.behind(self.pulse)
        if not self._keeping_up.is_lost(behind):
            return
        self.left_out += self.aligner.leave_out(self.pulse)
        if (more := self._leaving_out.record()) is not None:
            told = "decisions are %.1f s behind, and do not catch up%s: they go on with now"
            log.warning(told, behind / self.config.site.fps, more)

    def _decide_next(self) -> bool:
        epoch = self.aligner.next_ready(self.pulse)
        if epoch is not None:
            self._step(epoch)
        return epoch is not None

    def _record(self, out: Path) -> LiveDecisionWriter:
        try:
            return LiveDecisionWriter(out, self.config.camera_ids, self.decider.people.fits)
        except OSError as error:
            raise UserError(f"{out}: cannot write there: {error.strerror}") from error

    def choose_by(self, view: ViewSettings) -> None:
        """Choose views by other settings from the next GOP on, as far as a running service can.

        Raises:
            UserError: the look-ahead is not long enough, or longer than what is kept.
        """
        try:
            self.config.check_lookahead(view)
        except ValueError as error:
            raise UserError(str(error)) from error
        if view.lookahead > self.most_lookahead:
            raise UserError(
                f"view.lookahead: is {view.lookahead} frames but can be at most {self.most_lookahead} while "
                "the service runs: what it keeps reaches no further; a longer view.buffer_s and a restart do"
            )
        self.decider.choose_by(view)

    def go_by(self, config: Config) -> None:
        """Go by a configuration that differs in what a running service can do, and in what only cameras do.

        What was tried out meanwhile ends where the configuration says something else about the choice.

        Raises:
            UserError: the look-ahead is not long enough, or longer than what is kept.
        """
        if config.view != self.config.view:
            self.choose_by(config.view)
        ground = {it.id: {"ground": it.ground} for it in self.config.cameras}  # the scene's is in no file
        cameras = [it.model_copy(update=ground[it.id]) for it in config.cameras]
        self.config = config.model_copy(update={"cameras": cameras})

    def close(self) -> None:
        """End all streams and let go of the bus and the files."""
        with contextlib.ExitStack() as closing:  # all of them, whatever one of them says; the last one first
            if self._bus is not None:
                closing.callback(self._bus.close)
            if self._recorder is not None:
                closing.callback(self._recorder.close)
            closing.callback(self.past.close)
            closing.callback(self.walking.stop)
            closing.callback(self.splicer.close)

    async def _follow_pulses(self) -> None:
        sync, fps = self.config.sync, self.config.site.fps
        name = bestview_client_name(self.config.view.share.index)
        async with PulseClient(
            sync.host, sync.port, name, fps_hint=fps, credentials=self.pulse_credentials, tls=self.pulse_tls
        ) as pulses:
            self._clock = pulses.now
            async for pulse in pulses:
                self.pulse = pulse.number
                self.pulse0 = pulse.due - pulse.number / fps
                self._pulsed_at = time.monotonic()
                self._changed.set()

    @property
    def silent_s(self) -> float | None:
        """Seconds since the newest pulse; None before the first."""
        return None if self._pulsed_at is None else time.monotonic() - self._pulsed_at

    def _tracks(self, message: Message) -> None:
        self.intake.tracks(message)
        self._changed.set()

    def _alive(self, key: str, there: bool) -> None:
        self.intake.alive(key, there)
        self.state_replication.alive(key, there)
        self._changed.set()
        if self.state_replication.is_waiting:
            asyncio.get_running_loop().call_later(PATIENCE_S, self._changed.set)

    def _remembered(self, message: Message) -> None:
        self.intake.remembered(message, self.state_replication.snapshot_received)
        self._changed.set()

    def _step(self, epoch: Epoch) -> None:
        self._decided_to = epoch.last
        self.losses.epoch(epoch)
        self.walking.take(epoch)
        self.state_replication.begin(epoch.last)
        with self.stages.deciding():
            decisions = self.decider.step(epoch)
        self.state_replication.take(epoch.last)  # names are there with the first decision
        for decision in decisions:
            self._publish(decision)
        self.assist.step(epoch, self.config)

    def _tell_camera(self, what: str, camera: str, payload: bytes) -> None:
        if self._bus is not None:
            self._bus.publish(self._keys.camera(camera, what), payload)

    def _publish(self, decision: GopDecision) -> None:
        """Send a GOP's boxes, then its frames."""
        with self.stages.sending(lambda: self._late(decision.first)):
            self._send(decision)

    def _late(self, pulse: int) -> float | None:
        """Return the seconds since a pulse was due; None before the first pulse."""
        return None if self.pulse0 is None else self._clock() - self.pulse0 - pulse / self.config.site.fps

    def _send(self, decision: GopDecision) -> None:
        choices = self.board.put(decision)
        self.past.put(choices, self.pulse0, self.state_replication.numbers_since)
        for tell in self.on_decision:
            tell(choices)
        self.splicer.publish_decision(decision)
        self.splicer.forget(self.decider.people.known, decision.merged)
        if self._bus is not None:
            key = self._keys.bestview("choices", self.config.view.share.index)
            self._bus.publish(key, msgspec.json.encode(choices))
        if self._recorder is not None:
            self._recorder.write(decision)
        self.losses.gop(decision)
        self.intake.forget_thumbnails_before(decision.first - self.config.view.identity.forget_after)
