"""Flags: risk events of the cameras' trackers that an operator is asked to look at."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import Literal

import msgspec

from server.config.sections import FlagSettings
from server.service.operator_assist.flag_budget import FlagBudget
from tracking.types import RiskReason

FlagState = Literal["raised", "followed", "answered", "expired"]

_ANSWER_MARGIN_S = 0.4
"""Seconds after the expected failure until which the person must be marked to answer the flag."""
_MIN_SHIFT_S = 0.2
"""A shift of the expected time by less is not published."""
_MAX_ENDED = 100
"""Ended flags that are kept."""


class Flag(msgspec.Struct, frozen=True, kw_only=True):
    """A request to the operator to look at some people."""

    id: int
    """From 1, in the order in which they are raised."""
    objects: list[int]
    """The people at risk; the first is the one to point at."""
    cameras: list[str]
    """The cameras that predict the failure; the first predicted it first."""
    reason: RiskReason
    pulse: int
    """When the failure is expected."""
    raised: int
    """The pulse at which the flag was raised."""
    margin: float
    """The tracker's confidence, as a difference of costs: 0 is none."""
    risk: float
    """The probability of the failure without help, in [0, 1]."""
    state: FlagState
    """raised; followed: the operator marks positions; answered: until after the failure; expired: not
    answered."""

    @property
    def over(self) -> bool:
        """Whether the flag has ended."""
        return self.state in {"answered", "expired"}


@dataclass(frozen=True, slots=True)
class PersonRisk:
    """A risk event of one camera's tracker, with person numbers."""

    camera: str
    objects: tuple[int, ...]
    """The people at risk; the first is the one to point at."""
    reason: RiskReason
    pulse: int
    margin: float
    risk: float


class FlagQueue:
    """Raises flags and tracks their state. It has no clock: callers pass the pulse.

    Risk events of the same people, from several cameras or repeated, are one flag. The number of flags is
    limited; the riskiest events are flagged (`FlagBudget`).
    """

    def __init__(self, settings: FlagSettings, fps: float) -> None:
        self._settings, self._fps = settings, fps
        self._open: dict[int, Flag] = {}
        self._ended: deque[Flag] = deque(maxlen=_MAX_ENDED)
        self._budget = FlagBudget(settings, fps)
        self._pointed: dict[int, int] = {}
        """By flag, the last frame in which the operator pointed at its people."""
        self._published: dict[int, Flag] = {}
        """By flag, its state as last published."""
        self.counts: dict[str, int] = dict.fromkeys(("raised", "answered", "expired"), 0)
        self.on_flag: list[Callable[[Flag], None]] = []

    @property
    def open(self) -> list[Flag]:
        """Flags that can be answered, the most urgent first."""
        return sorted(self._open.values(), key=lambda flag: (flag.pulse, flag.margin, flag.id))

    @property
    def ended(self) -> list[Flag]:
        """Flags that have ended, the newest first."""
        return list(reversed(self._ended))

    def step(self, now: int, events: Iterable[PersonRisk], resolve: Callable[[int], int]) -> None:
        """Process the risk events at a pulse; ``resolve`` maps a merged number to its current one."""
        for flag in list(self._open.values()):
            self._put(self._resolved(flag, resolve))
        relevant = [event for event in events if event.reason in self._settings.reasons]
        for event in relevant:
            self._budget.record_risk(now, frozenset(event.objects), event.risk)
        for event in sorted(
            relevant, key=lambda event: (-event.risk, event.pulse, event.objects, event.camera)
        ):
            open_flag = self._open_flag_of(event)
            if open_flag is not None:
                self._update(open_flag, event)
            elif (
                event.objects
                and not self._has_ended(event)
                and self._budget.is_worth_flag(now, frozenset(event.objects), event.risk)
            ):
                self._raise(now, event)
        expiry = now - self._settings.answer_s * self._fps
        for flag in [flag for flag in self._open.values() if flag.pulse < expiry]:
            is_answered = self._pointed.get(flag.id, -1) >= flag.pulse
            self._end(flag, "answered" if is_answered else "expired")
        self._publish()

    def forget(self, numbers: Collection[int]) -> None:
        """End and drop the flags about these people."""
        gone = set(numbers)
        for flag in [flag for flag in self._open.values() if gone.intersection(flag.objects)]:
            self._end(flag, "expired")
        self._publish()
        self._ended = deque(
            (flag for flag in self._ended if gone.isdisjoint(flag.objects)), maxlen=_MAX_ENDED
        )

    def record_pointing(self, number: int, camera: str, pulses: Collection[int]) -> list[int]:
        """Record that the operator pointed at a person; return the flags that this responds to."""
        flags = [flag for flag in self._open.values() if number in flag.objects and camera in flag.cameras]
        for flag in flags:
            last = self._pointed[flag.id] = max(self._pointed.get(flag.id, -1), *pulses)
            if last >= flag.pulse + _ANSWER_MARGIN_S * self._fps:
                self._end(flag, "answered")
            else:
                self._put(msgspec.structs.replace(flag, state="followed"))
        self._publish()
        return [flag.id for flag in flags]

    def _raise(self, now: int, event: PersonRisk) -> None:
        self.counts["raised"] += 1
        self._budget.record_flag(now, frozenset(event.objects))
        self._put(
            Flag(
                id=self.counts["raised"],
                objects=list(event.objects),
                cameras=[event.camera],
                reason=event.reason,
                pulse=event.pulse,
                raised=now,
                margin=event.margin,
                risk=event.risk,
                state="raised",
            )
        )

    def _update(self, flag: Flag, event: PersonRisk) -> None:
        """Update a flag by a later event of its failure; once the operator points, its time stays."""
        cameras = flag.cameras if event.camera in flag.cameras else [*flag.cameras, event.camera]
        flag = msgspec.structs.replace(flag, cameras=cameras)
        if flag.state == "raised" and event.camera == cameras[0]:
            flag = msgspec.structs.replace(flag, pulse=event.pulse, margin=event.margin, risk=event.risk)
        self._put(flag)

    def _open_flag_of(self, event: PersonRisk) -> Flag | None:
        """Return the open flag of the same people."""
        return next((flag for flag in self.open if set(flag.objects) == set(event.objects)), None)

    def _has_ended(self, event: PersonRisk) -> bool:
        """Return whether a flag that has ended was about the same event."""
        earliest = event.pulse - self._settings.answer_s * self._fps
        return any(set(flag.objects) == set(event.objects) and flag.pulse >= earliest for flag in self._ended)

    def _resolved(self, flag: Flag, resolve: Callable[[int], int]) -> Flag:
        return msgspec.structs.replace(flag, objects=list(dict.fromkeys(map(resolve, flag.objects))))

    def _put(self, flag: Flag) -> None:
        self._open[flag.id] = flag

    def _end(self, flag: Flag, state: FlagState) -> None:
        self.counts[state] += 1
        self._open.pop(flag.id)
        self._pointed.pop(flag.id, None)
        self._ended.append(msgspec.structs.replace(flag, state=state))

    def _publish(self) -> None:
        """Notify the listeners of changed flags."""
        ended = [flag for flag in self._ended if flag.id in self._published]
        for flag in [*ended, *self.open]:
            before = self._published.get(flag.id)
            if before is not None and not self._differs(before, flag):
                continue
            self._published[flag.id] = flag
            for callback in self.on_flag:
                callback(flag)
        for flag in ended:
            del self._published[flag.id]

    def _differs(self, before: Flag, now: Flag) -> bool:
        moved = abs(before.pulse - now.pulse) >= _MIN_SHIFT_S * self._fps
        same = (before.objects, before.cameras, before.state) == (now.objects, now.cameras, now.state)
        return moved or not same
