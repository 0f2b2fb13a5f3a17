"""The rule engine: evaluates a site's rules on its decisions, live and for recordings alike."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import msgspec

from bestview import Merge
from server.config.site_config import Config
from server.media.letterbox import Letterbox
from server.messaging.epochs import utc_time_of_pulse
from server.rules import Circumstances, RuleEvent
from server.service.rules.positions import people_of_frames
from server.service.rules.setup import create_evaluator
from server.service.view_selection.decider import GopDecision

_USABLE = frozenset({"clear", "blurred", "noisy"})
"""Conditions of a picture in which boxes are still where people are."""


class SiteEvent(msgspec.Struct, frozen=True):
    """What a rule has found, as files, the API, webhooks and MQTT give it."""

    rule: str
    """Its id."""
    kind: str
    """entered, left, crossed, stayed, crowded or close."""
    phase: str
    """once; or began and ended, of what lasts."""
    zone: str | None
    """The rule's zone; null: anywhere."""
    objects: list[int]
    """The people's numbers."""
    names: list[str | None]
    """Their names, in the same order; null: none."""
    direction: str | None
    """inward or outward over a line, else null."""
    pulse: int
    """When it happened."""
    time: str | None
    """The same in UTC, ISO 8601; null: unknown, as in recordings."""
    confirmed: int
    """The pulse at which it had lasted long enough to count."""
    camera: str | None
    """The camera whose view is chosen for the first of the people then; null: none."""


class RuleEngine:
    """Evaluates the rules of a configuration, GOP by GOP in order.

    Args:
        config: the site.
        letterboxes: by camera; may grow.
    """

    def __init__(self, config: Config, letterboxes: Mapping[str, Letterbox]) -> None:
        self._letterboxes = letterboxes
        self._overhead = config.overhead
        self._has_area = bool(config.view.sharding.areas)
        self.apply(config)

    def apply(self, config: Config) -> None:
        """Evaluate another configuration's rules from now on, on what is seen from now on."""
        self._fps = config.site.fps
        self._evaluator = create_evaluator(config)
        self._is_off = not config.zones and not config.rules

    @property
    def people_in(self) -> Mapping[str, list[int]]:
        """The people in each area, by its id."""
        return self._evaluator.people_in

    @property
    def lasting(self) -> frozenset[str]:
        """The ids of rules of which something has begun and not ended."""
        return self._evaluator.lasting

    def forget(self, numbers: Iterable[int]) -> None:
        """Forget people, without an event."""
        for number in numbers:
            self._evaluator.forget(number)

    def put(
        self, decision: GopDecision, names: Mapping[int, str], pulse0: float | None = None
    ) -> list[SiteEvent]:
        """Process a decision; return events.

        ``pulse0`` is when pulse 0 was due, unix seconds; None: unknown: rules with a schedule do not apply.
        """
        if self._is_off:
            return []
        for correction in decision.corrections:
            if isinstance(correction, Merge):
                self._evaluator.merge(correction.kept, correction.lost)
            else:
                self._evaluator.split(correction.published_id, correction.corrected_id)
        conditions = {camera: state.condition for camera, state in decision.pictures.items()}
        usable = frozenset(camera for camera, condition in conditions.items() if condition in _USABLE)
        circumstances = Circumstances(
            None if pulse0 is None else pulse0 + decision.first / self._fps,
            names,
            frozenset(camera for camera, condition in conditions.items() if condition == "clear"),
            usable,
        )
        cameras = {choice.number: choice.camera for choice in decision.choices}
        if self._has_area:  # who is known here, but in another area, is for its service
            decision = replace(
                decision,
                boxes={
                    camera: [[box for box in frame if box[0] in cameras] for frame in frames]
                    for camera, frames in decision.boxes.items()
                },
            )
        return [
            self._describe(event, names, cameras, pulse0)
            for frame in people_of_frames(decision, usable, self._letterboxes, self._overhead)
            for event in self._evaluator.step(frame, circumstances)
        ]

    def _describe(
        self,
        event: RuleEvent,
        names: Mapping[int, str],
        cameras: Mapping[int, str | None],
        pulse0: float | None,
    ) -> SiteEvent:
        return SiteEvent(
            rule=event.rule,
            kind=event.kind.value,
            phase=event.phase.value,
            zone=event.zone,
            objects=list(event.people),
            names=[names.get(person) for person in event.people],
            direction=None if event.direction is None else event.direction.value,
            pulse=event.pulse,
            time=utc_time_of_pulse(event.pulse, self._fps, pulse0),
            confirmed=event.confirmed,
            camera=next((cameras[person] for person in event.people if cameras.get(person)), None),
        )
