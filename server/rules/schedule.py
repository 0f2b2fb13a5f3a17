"""Schedules: the days and hours at which a rule applies, in the site's time zone."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, time, tzinfo

DAYS = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")


@dataclass(frozen=True, slots=True)
class Schedule:
    """Days of the week, and a span of hours that may pass midnight.

    Attributes:
        days: of `DAYS`; a span that passes midnight belongs to the day on which it begins.
        begins: the time of day at which it begins.
        ends: the first time of day that is outside; equal to ``begins``: all day.
        zone: the time zone; None: this machine's.
    """

    days: frozenset[str] = frozenset(DAYS)
    begins: time = time()
    ends: time = time()
    zone: tzinfo | None = None

    def includes(self, moment: float) -> bool:
        """Return whether a moment, unix seconds, is in the schedule."""
        local = datetime.fromtimestamp(moment, self.zone)
        day, clock = local.weekday(), local.time()
        if self.begins == self.ends:
            return DAYS[day] in self.days
        if self.begins < self.ends:
            return DAYS[day] in self.days and self.begins <= clock < self.ends
        return (clock >= self.begins and DAYS[day] in self.days) or (
            clock < self.ends and DAYS[day - 1] in self.days
        )
