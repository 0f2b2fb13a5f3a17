"""The age clock of a recording: counts seconds that have certainly passed, and never goes back.

The machine's clock may jump: it is set manually, its battery is empty, or it is wrong until NTP corrects it.
If it determined the age of recordings, a jump might delete all of them. So the age of recordings is counted
by

* the steady clock of the machine, which counts while it sleeps, and across restarts of the service until the
  machine itself starts again (its boot has another id);
* the machine's wall clock, only for the time that the machine was off: if it is synchronized now and was when
  it was last compared (by NTP, or by ``record.trust_clock``), and has not jumped for ten minutes. Jumps while
  the service runs never count.

Without a synchronized clock, the time that the machine was off does not count: recordings are kept longer,
never shorter.
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
_STABLE_S = 600.0
"""How long the wall clock must not have jumped before it counts."""
_JUMP_S = 5.0
_DRIFT = 0.002
"""The relative drift of two clocks that is no jump: NTP slews by a quarter of it."""
_SHORTEST_OFF_S = 60.0
"""A shorter time without power is ignored."""


def _steady() -> float:
    """Return seconds that never jump; where the system supports it, they count during suspend."""
    boottime = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic() if boottime is None else time.clock_gettime(boottime)


def _boot() -> str:
    """Return the id of the machine's boot; empty if the system has none."""
    try:
        return _BOOT_ID.read_text(encoding="utf-8").strip()
    except (OSError, ValueError):
        return ""


@dataclass(frozen=True, slots=True)
class MachineClocks:
    """The machine's clocks, replaceable in tests."""

    wall: Callable[[], float] = time.time
    """Unix seconds: may jump."""
    steady: Callable[[], float] = _steady
    """Seconds since the machine's boot: never jump."""
    boot: Callable[[], str] = _boot
    """The boot id: while it is the same, the steady clock continues."""
    is_synchronized: Callable[[], bool] = lambda: is_clock_synchronized() is True
    """Whether the wall clock is synchronized."""


class AgeClockState(msgspec.Struct, frozen=True, kw_only=True):
    """The content of ``clock.json``: the age clock, and the machine's clocks at the same moment."""

    id: Annotated[str, msgspec.Meta(min_length=1, max_length=64)]
    """Identifies the age clock: ages of different clocks cannot be compared."""
    seconds: Annotated[float, msgspec.Meta(ge=0, le=1e12)]
    """The age clock."""
    boot: str
    steady: float
    origin: float | None
    """When the age clock was 0, unix seconds, by a synchronized clock; null: none was synchronized."""
    anchored: float = 0.0
    """The age clock when ``origin`` was last confirmed: the machine was on until then."""


class AgeClock:
    """The clock by which recordings age: data written at *a* has the age *b - a* at *b*."""

    def __init__(self, folder: Path, machine: MachineClocks, *, trust_clock: bool) -> None:
        self.id = ""
        self._path, self._machine, self._trust_clock = folder / STATE_FILE, machine, trust_clock
        self._seconds, self._at = 0.0, machine.steady()
        self._origin: float | None = None
        self.anchored = 0.0
        """The age clock when it last agreed with the wall clock: time without power is after it."""
        self._difference, self._compared_at = machine.wall() - machine.steady(), machine.steady()
        """The difference of the two machine clocks, and when it was last measured."""
        self._right_since = self._compared_at
        self._agrees = False
        """Whether the wall clock was synchronized and agreed with this one at the last update."""
        self._last_warning = ""

    def open(self) -> None:
        """Continue from the saved state; without one, a new age clock starts."""
        machine, steady = self._machine, self._machine.steady()
        try:
            state = msgspec.json.decode(self._path.read_bytes(), type=AgeClockState)
        except (OSError, *DECODE_ERRORS):
            self.id = uuid.uuid4().hex
            self._seconds, self._at, self._origin, self.anchored = 0.0, steady, None, 0.0
            return
        self.id = state.id
        self._seconds, self._at = state.seconds, steady
        self._origin, self.anchored = state.origin, state.anchored
        if state.boot and state.boot == machine.boot():
            self._seconds += max(0.0, steady - state.steady)

    @property
    def now(self) -> float:
        """The age clock, seconds."""
        return self._seconds + max(0.0, self._machine.steady() - self._at)

    @property
    def is_wall_clock_trusted(self) -> bool:
        """Whether the wall clock can be trusted now."""
        return self._trust_clock or self._machine.is_synchronized()

    def wall(self) -> float:
        """Return the wall clock, unix seconds."""
        return self._machine.wall()

    def add_off_time(self) -> float:
        """Add the time without power, by the wall clock, once that can be trusted.

        Returns:
            The seconds by which the age clock was moved forward: sessions recorded since the machine is on
            again, after :attr:`anchored`, are not older by them.
        """
        steady, wall = self._machine.steady(), self._machine.wall()
        difference, passed = wall - steady, steady - self._compared_at
        is_trusted, jumped = (
            self.is_wall_clock_trusted,
            abs(difference - self._difference) > _JUMP_S + _DRIFT * passed,
        )
        if not is_trusted or jumped:
            self._right_since = steady
        if jumped and self._agrees:  # the machine was not off: no time is added
            self._origin, self._agrees = None, False
        self._difference, self._compared_at = difference, steady
        off_s = 0.0 if self._origin is None else wall - self._origin - self.now
        if off_s < _SHORTEST_OFF_S:
            self._last_warning = ""
            if is_trusted:
                self._origin, self._agrees, self.anchored = wall - self.now, True, self.now
        elif not is_trusted:
            self._warn_once("unsynchronized", off_s)
        elif steady - self._right_since < _STABLE_S:
            self._warn_once("pending", off_s, wall + _STABLE_S - (steady - self._right_since))
        else:
            self._seconds += off_s
            self._last_warning = ""
            log.warning(
                "recording: %s in which this machine was off now count for record.keep_s",
                _duration_text(off_s),
            )
            return off_s
        return 0.0

    def save(self) -> None:
        """Save the state.

        Raises:
            OSError: writing fails; the file is unchanged.
        """
        machine = self._machine
        state = AgeClockState(
            id=self.id,
            seconds=self.now,
            boot=machine.boot(),
            steady=machine.steady(),
            origin=self._origin,
            anchored=self.anchored,
        )
        draft = self._path.with_suffix(".new")
        try:
            write_private(draft, msgspec.json.format(msgspec.json.encode(state)) + b"\n")
            draft.replace(self._path)
        except OSError:
            draft.unlink(missing_ok=True)
            raise

    def _warn_once(self, event: str, off_s: float, counted_from: float = math.nan) -> None:
        if self._last_warning == event:
            return
        self._last_warning = event
        text = f"recording: by its clock this machine was off for {_duration_text(off_s)}"
        if event == "unsynchronized":
            log.warning(
                "%s; that does not count for record.keep_s, since the clock is not synchronized (NTP): "
                "if it is right, set record.trust_clock: true",
                text,
            )
        else:
            log.warning(
                "%s; from %s on that counts, and recordings older than record.keep_s are deleted: "
                "if the clock is wrong, correct it before",
                text,
                _time_text(counted_from),
            )


def _duration_text(seconds: float) -> str:
    """Return a duration as text: in hours, from two days on in days."""
    hours = seconds / 3600
    return f"{hours / 24:.1f} days" if hours >= 48 else f"{hours:.1f} hours"  # noqa: PLR2004


def _time_text(unix: float) -> str:
    try:
        return datetime.fromtimestamp(unix, UTC).strftime("%Y-%m-%d %H:%M UTC")
    except (OverflowError, ValueError, OSError):
        return "then"
