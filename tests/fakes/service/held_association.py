"""Associations that a test holds."""

from __future__ import annotations

import threading
from typing import Any

from bestview import IdentityUpdate
from fakes.timeouts import PATIENCE
from server.service.identity.person_tracker import PersonTracker


def hold(tracker: PersonTracker) -> threading.Event:
    """Hold the next associations until the event is set."""
    released, update = threading.Event(), tracker._registry.update

    def held(*args: Any) -> IdentityUpdate:
        assert released.wait(PATIENCE)
        return update(*args)

    tracker._registry.update = held  # type: ignore[method-assign]
    return released


def release_when_waited_for(tracker: PersonTracker, released: threading.Event) -> None:
    """Release the running association as soon as somebody waits for its result."""
    running = tracker._association
    assert running is not None
    result = running.numbers.result

    def waited(timeout: float | None = None) -> IdentityUpdate:
        released.set()
        return result(timeout)

    running.numbers.result = waited  # type: ignore[method-assign]
