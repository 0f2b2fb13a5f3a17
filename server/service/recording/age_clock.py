"""How old what is recorded is: counted in time that has certainly passed, not read off a clock that was set.

The machine's clock may jump: it is set by hand, its battery is empty, or it is wrong until NTP puts it right.
Whoever takes away by it what is too old may take away everything. So a recording has a clock of its own, in
seconds, which only ever goes forward. It goes by

* the steady clock of the machine, which counts while it sleeps, and across restarts of the service until the
  machine itself starts again (its boot has another id);
* the machine's clock alone for the time that the machine was off: if it is kept right now, and was when the
  recording last went by it, by NTP as the system has it or by the operator's word (``record.trust_clock``),
  and if it has not jumped for ten minutes. That it jumps while the service runs never counts.

Where nobody vouches for the machine's clock, the time that the machine was off does not count: what is
recorded is kept for longer, never for less long.
"""

from __future__ import annotations

import logging
import math
import time
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import msgspec

from server.messaging.messages import DECODE_ERRORS
from server.system.clock_sync import is_clock_synchronized
from server.system.private_files import write_private

log = logging.getLogger(__name__)

STATE_FILE = "clock.json"
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
_TRIAL_S = 600.0
"""For so long the machine's clock has not jumped before it counts."""
_JUMP_S = 5.0
_DRIFT = 0.002
"""Part by which two clocks may go apart without a jump: NTP slews by a quarter of it."""
_AWAY_S = 60.0
"""What the machine was off for less is not asked after."""


def _steady() -> float:
    """Return seconds that never jump; where the system has it, those that the machine sleeps count, too."""
    boottime = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic() if boottime is None else time.clock_gettime(boottime)


def _boot() -> str:
    """Return the id of the machine's boot; empty where the system does not say."""
    try:
        return _BOOT_ID.read_text(encoding="utf-8").strip()
    except (OSError, ValueError):
        return ""


@dataclass(frozen=True, slots=True)
class MachineClocks:
    """The machine's clocks, and what is known of them."""

    wall: Callable[[], float] = time.time
    """Unix seconds: may jump."""
    steady: Callable[[], float] = _steady
    """Seconds since the machine's boot: never jump."""
    boot: Callable[[], str] = _boot
    """While it is the same, the steady clock goes on."""
    is_kept: Callable[[], bool] = lambda: is_clock_synchronized() is True
    """Whether somebody keeps the first one right."""


class AgeClockState(msgspec.Struct, frozen=True, kw_only=True):
    """What ``clock.json`` says: the recording's clock, and the machine's clocks at that moment."""

    id: Annotated[str, msgspec.Meta(min_length=1, max_length=64)]
    """Of this clock: another one says nothing about what was recorded by this one."""
    seconds: Annotated[float, msgspec.Meta(ge=0, le=1e12)]
    """The recording's clock."""
    boot: str
    steady: float
    origin: float | None
    """When the recording's clock was 0, unix seconds, by a clock that was kept right; null: none was."""
    anchored: float = 0.0
    """What the recording's clock said when that was last seen to be so: the machine was on until then."""


class AgeClock:
    """The clock of a recording: what was written when it said *a* is older by *b - a* when it says *b*."""

    def __init__(self, folder: Path, machine: MachineClocks, *, trusted: bool) -> None:
        self.id = ""
        self._path, self._machine, self._trusted = folder / STATE_FILE, machine, trusted
        self._seconds, self._at = 0.0, machine.steady()
        self._origin: float | None = None
        self.anchored = 0.0
        """When this clock last went beside the machine's: if that was off since, it was after this."""
        self._apart, self._looked = machine.wall() - machine.steady(), machine.steady()
        """How far the two clocks were apart, and when that was looked at."""
        self._right_since = self._looked
        self._follows = False
        """Whether the machine's clock was right and went beside this one when it was looked at last."""
        self._told = ""

    def open(self) -> None:
        """Go on from what the ledger says; where there is none another clock begins."""
        machine, steady = self._machine, self._machine.steady()
        try:
            ledger = msgspec.json.decode(self._path.read_bytes(), type=AgeClockState)
        except (OSError, *DECODE_ERRORS):
            self.id = uuid.uuid4().hex
            self._seconds, self._at, self._origin, self.anchored = 0.0, steady, None, 0.0
            return
        self.id = ledger.id
        self._seconds, self._at = ledger.seconds, steady
        self._origin, self.anchored = ledger.origin, ledger.anchored
        if ledger.boot and ledger.boot == machine.boot():
            self._seconds += max(0.0, steady - ledger.steady)

    @property
    def now(self) -> float:
        """Seconds."""
        return self._seconds + max(0.0, self._machine.steady() - self._at)

    @property
    def is_right(self) -> bool:
        """Whether the machine's own clock is to be believed now, as far as anybody knows."""
        return self._trusted or self._machine.is_kept()

    def wall(self) -> float:
        """Return the time by the machine's own clock, unix seconds."""
        return self._machine.wall()

    def look(self) -> float:
        """Look at the machine's clock: the time that it was off counts once that is to be believed.

        Return the seconds by which this clock goes forward for that: what was recorded since the machine is
        on again, after :attr:`anchored`, is no older by them.
        """
        steady, wall = self._machine.steady(), self._machine.wall()
        apart, passed = wall - steady, steady - self._looked
        is_right, jumped = self.is_right, abs(apart - self._apart) > _JUMP_S + _DRIFT * passed
        if not is_right or jumped:
            self._right_since = steady
        if jumped and self._follows:  # the machine was not off meanwhile: nothing is owed
            self._origin, self._follows = None, False
        self._apart, self._looked = apart, steady
        away = 0.0 if self._origin is None else wall - self._origin - self.now
        if away < _AWAY_S:
            self._told = ""
            if is_right:
                self._origin, self._follows, self.anchored = wall - self.now, True, self.now
        elif not is_right:
            self._tell_once("unkept", away)
        elif steady - self._right_since < _TRIAL_S:
            self._tell_once("trial", away, wall + _TRIAL_S - (steady - self._right_since))
        else:
            self._seconds += away
            self._told = ""
            log.warning(
                "recording: %s in which this machine was off count now for record.keep_s", _span(away)
            )
            return away
        return 0.0

    def keep(self) -> None:
        """Write the ledger.

        Raises:
            OSError: it cannot be written; it is as before.
        """
        machine = self._machine
        ledger = AgeClockState(
            id=self.id,
            seconds=self.now,
            boot=machine.boot(),
            steady=machine.steady(),
            origin=self._origin,
            anchored=self.anchored,
        )
        draft = self._path.with_suffix(".new")
        try:
            write_private(draft, msgspec.json.format(msgspec.json.encode(ledger)) + b"\n")
            draft.replace(self._path)
        except OSError:
            draft.unlink(missing_ok=True)
            raise

    def _tell_once(self, what: str, away: float, counted_from: float = math.nan) -> None:
        if self._told == what:
            return
        self._told = what
        said = f"recording: by its clock this machine was off for {_span(away)}"
        if what == "unkept":
            log.warning(
                "%s; that does not count for record.keep_s, since nobody keeps the clock right (NTP): "
                "if it is right, record.trust_clock: true counts it",
                said,
            )
        else:
            log.warning(
                "%s; from %s on that counts, and what is older than record.keep_s is taken away: "
                "if the clock is wrong, set it right before",
                said,
                _moment(counted_from),
            )


def _span(seconds: float) -> str:
    """Write a time span for people: in hours, from two days on in days."""
    hours = seconds / 3600
    return f"{hours / 24:.1f} days" if hours >= 48 else f"{hours:.1f} hours"  # noqa: PLR2004


def _moment(unix: float) -> str:
    try:
        return datetime.fromtimestamp(unix, UTC).strftime("%Y-%m-%d %H:%M UTC")
    except (OverflowError, ValueError, OSError):
        return "then"
