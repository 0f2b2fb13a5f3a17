"""Operations: readiness, the pulse server's clients, and view settings that can change at run time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import msgspec

from camsync import SyncError, query_clients
from server.config.pulse_access import pulse_clients
from server.config.sections import ViewSettings
from server.service.pipeline import BestViewPipeline
from server.service.readiness import why_not_ready


@dataclass(frozen=True, slots=True)
class Readiness:
    """Whether a best view can be served now."""

    reasons: list[str]
    """Why not; empty: it can."""
    live_cameras: int
    cameras: int


class PulseListener(msgspec.Struct, frozen=True):
    """A client of the pulse server."""

    name: str | None
    """Null: an unnamed client, which only receives pulses."""
    expected: bool
    """Whether the configuration names it."""
    behind: int
    """Pulses that it recently lost because it read too slowly."""


class PulseClients(msgspec.Struct, frozen=True):
    """The pulse server's clients."""

    server: str
    """Its host and port."""
    error: str
    """Why the server did not respond; empty: it did."""
    clients: list[PulseListener]
    missing: list[str]
    """Clients that the configuration names but that are not connected."""


class OperationsService:
    """Queries and commands about the service itself."""

    def __init__(self, pipeline: BestViewPipeline) -> None:
        self._pipeline = pipeline

    def subscribe_config(self, callback: Callable[[], None]) -> None:
        """Call back after a changed configuration has been applied."""
        self._pipeline.on_config.append(callback)

    def readiness(self) -> Readiness:
        """Return whether a best view can be served: pulses and frames arrive, and decisions keep up."""
        states = self._pipeline.ingest.states.values()
        live = sum(state.label == "live" for state in states)
        return Readiness(why_not_ready(self._pipeline), live, len(states))

    async def list_pulse_clients(self) -> PulseClients:
        """Query the pulse server's clients."""
        config = self._pipeline.config
        sync, expected = config.sync, pulse_clients(config)
        address = f"{sync.host}:{sync.port}"
        try:
            clients = await query_clients(
                sync.host,
                sync.port,
                credentials=self._pipeline.pulses.credentials,
                tls=self._pipeline.pulses.tls,
            )
        except SyncError as error:
            return PulseClients(address, str(error), [], [])
        listeners = [
            PulseListener(client.name, client.name in expected, client.dropped_in_a_row) for client in clients
        ]
        connected = {client.name for client in clients}
        return PulseClients(address, "", listeners, [name for name in expected if name not in connected])

    @property
    def view_settings(self) -> ViewSettings:
        """The view settings in force."""
        return self._pipeline.decider.view

    @property
    def max_lookahead(self) -> int:
        """The longest look-ahead that can be set while the service runs, in frames."""
        return self._pipeline.max_lookahead

    def change_view_settings(self, view: ViewSettings) -> None:
        """Apply view settings until they are changed again or the service ends.

        Raises:
            UserError: the look-ahead is too short, or longer than the frame buffers allow.
        """
        self._pipeline.apply_live_view_settings(view)

    def reset_view_settings(self) -> None:
        """Apply the configuration's view settings again."""
        self._pipeline.apply_live_view_settings(self._pipeline.config.view)
