"""Events that repeat, as few log lines."""

from logthrottle.throttle import EndedEvents, LogThrottle

__all__ = ["EndedEvents", "LogThrottle"]
