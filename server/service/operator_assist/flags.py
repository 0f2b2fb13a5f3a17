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

_THROUGH_S = 0.4
"""For how long after what was expected somebody must be followed for it to be answered."""
_TOLD_S = 0.2
"""A time that has moved by less is not told again."""
_ENDED_MOST = 100
"""Flags that are over and are kept."""


class Flag(msgspec.Struct, frozen=True, kw_only=True):
    """A request to an operator to look at some persons."""

    id: int
    """From 1, in the order in which they are raised."""
    objects: list[int]
    """Whom it is about: point at the first of them."""
    cameras: list[str]
    """Where it is foreseen; the first foresaw it first."""
    reason: RiskReason
    pulse: int
    """When it is expected."""
    raised: int
    """The newest pulse when it was raised."""
    margin: float
    """By how much the tracker is sure, as a cost: 0 is not at all."""
    risk: float
    """How likely it is to go wrong unless somebody helps, in [0, 1]."""
    state: FlagState
    """raised; followed: somebody points at them; answered: was followed through it; expired: was not."""

    @property
    def over(self) -> bool:
        """Whether nothing changes any more."""
        return self.state in {"answered", "expired"}


@dataclass(frozen=True, slots=True)
class RiskEvent:
    """A risk event of one camera's tracker, with person numbers."""

    camera: str
    objects: tuple[int, ...]
    """Whom it is about; first whom to point at."""
    reason: RiskReason
    pulse: int
    margin: float
    risk: float


class FlagQueue:
    """Raises flags, and sees them through. It has no clock: it is told which pulse it is.

    What several cameras foresee of the same people, or one foresees again and again, is one flag. Of more
    than may be raised in a minute the riskiest are (`FlagBudget`).
    """

    def __init__(self, settings: FlagSettings, fps: float) -> None:
        self._settings, self._fps = settings, fps
        self._open: dict[int, Flag] = {}
        self._ended: deque[Flag] = deque(maxlen=_ENDED_MOST)
        self._budget = FlagBudget(settings, fps)
        self._pointed: dict[int, int] = {}
        """By flag, the last frame in which somebody was pointed at."""
        self._told: dict[int, Flag] = {}
        self.counts: dict[str, int] = dict.fromkeys(("raised", "answered", "expired"), 0)
        self.on_flag: list[Callable[[Flag], None]] = []

    @property
    def open(self) -> list[Flag]:
        """Those that can be answered, the most urgent first."""
        return sorted(self._open.values(), key=lambda it: (it.pulse, it.margin, it.id))

    @property
    def ended(self) -> list[Flag]:
        """Those that are over, the newest first."""
        return list(reversed(self._ended))

    def step(self, now: int, foreseen: Iterable[RiskEvent], resolve: Callable[[int], int]) -> None:
        """Take in what is foreseen at a pulse; ``resolve`` gives the number that a merged one goes by now."""
        for flag in list(self._open.values()):
            self._put(self._resolved(flag, resolve))
        wanted = [it for it in foreseen if it.reason in self._settings.reasons]
        for it in wanted:
            self._budget.hear(now, frozenset(it.objects), it.risk)
        for it in sorted(wanted, key=lambda it: (-it.risk, it.pulse, it.objects, it.camera)):
            known = self._about(it)
            if known is not None:
                self._see_again(known, it)
            elif it.objects and not self._was(it) and self._budget.worth(now, frozenset(it.objects), it.risk):
                self._raise(now, it)
        late = now - self._settings.answer_s * self._fps
        for flag in [flag for flag in self._open.values() if flag.pulse < late]:
            through = self._pointed.get(flag.id, -1) >= flag.pulse
            self._end(flag, "answered" if through else "expired")
        self._tell()

    def pointed(self, number: int, camera: str, pulses: Collection[int]) -> list[int]:
        """Note that somebody was pointed at in a camera's frames; give the flags that this follows."""
        mine = [it for it in self._open.values() if number in it.objects and camera in it.cameras]
        for flag in mine:
            last = self._pointed[flag.id] = max(self._pointed.get(flag.id, -1), *pulses)
            if last >= flag.pulse + _THROUGH_S * self._fps:
                self._end(flag, "answered")
            else:
                self._put(msgspec.structs.replace(flag, state="followed"))
        self._tell()
        return [flag.id for flag in mine]

    def _raise(self, now: int, it: RiskEvent) -> None:
        self.counts["raised"] += 1
        self._budget.spend(now, frozenset(it.objects))
        self._put(
            Flag(
                id=self.counts["raised"],
                objects=list(it.objects),
                cameras=[it.camera],
                reason=it.reason,
                pulse=it.pulse,
                raised=now,
                margin=it.margin,
                risk=it.risk,
                state="raised",
            )
        )

    def _see_again(self, flag: Flag, it: RiskEvent) -> None:
        """Take over what a camera says later: it knows better when, but what is followed stays as it is."""
        cameras = flag.cameras if it.camera in flag.cameras else [*flag.cameras, it.camera]
        flag = msgspec.structs.replace(flag, cameras=cameras)
        if flag.state == "raised" and it.camera == cameras[0]:
            flag = msgspec.structs.replace(flag, pulse=it.pulse, margin=it.margin, risk=it.risk)
        self._put(flag)

    def _about(self, it: RiskEvent) -> Flag | None:
        """Return the open flag of the same persons."""
        return next((flag for flag in self.open if set(flag.objects) == set(it.objects)), None)

    def _was(self, it: RiskEvent) -> bool:
        """Return whether a flag that has ended was about the same event."""
        late = it.pulse - self._settings.answer_s * self._fps
        return any(set(flag.objects) == set(it.objects) and flag.pulse >= late for flag in self._ended)

    def _resolved(self, flag: Flag, resolve: Callable[[int], int]) -> Flag:
        return msgspec.structs.replace(flag, objects=list(dict.fromkeys(map(resolve, flag.objects))))

    def _put(self, flag: Flag) -> None:
        self._open[flag.id] = flag

    def _end(self, flag: Flag, state: FlagState) -> None:
        self.counts[state] += 1
        self._open.pop(flag.id)
        self._pointed.pop(flag.id, None)
        self._ended.append(msgspec.structs.replace(flag, state=state))

    def _tell(self) -> None:
        """Notify the listeners of changed flags."""
        over = [flag for flag in self._ended if flag.id in self._told]
        for flag in [*over, *self.open]:
            before = self._told.get(flag.id)
            if before is not None and not self._differs(before, flag):
                continue
            self._told[flag.id] = flag
            for tell in self.on_flag:
                tell(flag)
        for flag in over:
            del self._told[flag.id]

    def _differs(self, before: Flag, now: Flag) -> bool:
        moved = abs(before.pulse - now.pulse) >= _TOLD_S * self._fps
        same = (before.objects, before.cameras, before.state) == (now.objects, now.cameras, now.state)
        return moved or not same
