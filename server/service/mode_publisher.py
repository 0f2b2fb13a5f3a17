"""Publishes decisions for viewers with another delay: events, frames and files, and measures every delay."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from server.media.picture import EncodedPicture
from server.messaging.messages import GopChoices
from server.service.decision_files.live_decision_writer import LiveDecisionWriter
from server.service.metrics.delay_meter import DelayMeter
from server.service.streaming.splicer import Splicer
from server.service.view_selection.delay_modes import DelayMode, ModeDecision
from server.service.view_selection.mode_choices import ModeChoices


class ModePublisher:
    """Publishes what viewers with the delays live and smooth are shown.

    Attributes:
        meter: the measured delays.
        on_decision: called with each decision as an event, before its frames are sent.
    """

    def __init__(self, splicer: Splicer, meter: DelayMeter) -> None:
        self._splicer, self.meter = splicer, meter
        self._choices = ModeChoices()
        self.on_decision: list[Callable[[DelayMode, GopChoices], None]] = []

    def publish_frame(self, camera: str, frame: EncodedPicture) -> None:
        """Publish a camera's frame in all streams that are not delayed."""
        self.meter.measure_arrival(frame.pulse)
        self._splicer.publish_frame(camera, frame)

    def record_balanced(self, choices: GopChoices) -> None:
        """Record a decision of the delay balanced, before it is published."""
        self._choices.put(choices)
        self.meter.measure_decision(DelayMode.BALANCED, choices.first)

    def replace_balanced(self, change: Callable[[GopChoices], GopChoices]) -> None:
        """Replace every balanced decision that is kept for later ones by a changed one."""
        self._choices.replace(change)

    def publish(
        self,
        decisions: Sequence[ModeDecision],
        merged: Mapping[int, int],
        writer: LiveDecisionWriter | None,
        *,
        live: bool,
    ) -> None:
        """Publish the decisions of one delay: ``live``, or smooth."""
        for decision in decisions:
            if (decision.mode is DelayMode.LIVE) is not live:
                continue
            choices = self._choices.choices(decision)
            for callback in self.on_decision:
                callback(decision.mode, choices)
            if live:
                self.meter.measure_live_decision(decision)
                self._splicer.publish_live(decision, merged)
            else:
                self.meter.measure_decision(decision.mode, decision.first)
                self._splicer.publish_smooth(decision, merged)
            if writer is not None:
                writer.write_views_or_skip(decision)
