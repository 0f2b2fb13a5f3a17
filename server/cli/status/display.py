"""Terminal display of a site's status."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime

from rich.console import Group, RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from client import CameraNow, PersonNow, ServiceNow, SiteNow
from server.system.printable import printable

_STATES = {"live": "green", "ended": "cyan", "starting": "yellow"}
_MEGA = 1e6


@dataclass(frozen=True, slots=True)
class ServiceRates:
    """Rates of the service between two snapshots; None with only one, or after a restart of the service."""

    cores: float | None = None
    bytes_s: float | None = None

    @classmethod
    def between(cls, before: SiteNow | None, after: SiteNow) -> ServiceRates:
        """Compare two snapshots by the server's clock."""
        if before is None or before.service is None or after.service is None:
            return cls()
        seconds = after.now - before.now
        if seconds <= 0 or before.service.began != after.service.began:
            return cls()
        one, other = before.service, after.service
        return cls((other.cpu_s - one.cpu_s) / seconds, (other.sent_bytes - one.sent_bytes) / seconds)


def render_status(now: SiteNow, rates: ServiceRates, notice: str = "") -> RenderableType:
    """Render a site's status: headline, service, cameras, people; ``notice`` is about the connection."""
    parts: list[RenderableType] = [_head(now)]
    if now.service is not None:
        parts.append(_service(now.service, rates))
    if notice:
        parts.append(Text(printable(notice), style="yellow"))
    parts += [Text(), _cameras(now.cameras), Text(), _people(now.people)]
    return Group(*parts)


def _head(now: SiteNow) -> Text:
    pulse = "no pulse" if now.pulse is None else f"pulse {now.pulse}"
    ready = (f"ready: {printable(now.why)}", "green")
    if not now.ready:
        ready = (f"not ready: {printable(now.why)}", "red")
    return Text.assemble((printable(now.name), "bold"), f"  {_utc(now.now)}  {pulse}  ", ready)


def _service(service: ServiceNow, rates: ServiceRates) -> Text:
    kinds = ", ".join(f"{count} {kind}" for kind, count in service.viewers.items() if count)
    waiting = ", ".join(f"{count} {queue}" for queue, count in service.waiting.items() if count)
    parts = [
        f"viewers: {kinds or 'none'}",
        f"recording: {service.recorded_bytes / _MEGA:.0f} MB" if service.recording else "not recording",
        f"{_ms(service.delay_s)} from pulse to viewer",
        f"loop {_ms(service.lag_s)} late",
        f"{service.memory_bytes / _MEGA:.0f} MB",
    ]
    if rates.cores is not None and rates.bytes_s is not None:
        parts.append(f"{rates.cores:.2f} cores, {rates.bytes_s / _MEGA:.2f} MB/s out")
    if waiting:
        parts.append(f"waiting: {waiting}")
    return Text(printable("; ".join(parts)))


def _cameras(cameras: tuple[CameraNow, ...]) -> RenderableType:
    headings = ("camera", "state", "fps", "pulse", "tracks", "missed", "shed", "late", "waiting", "optimal")
    table = Table(*headings, box=None, header_style="dim", pad_edge=False)
    for column in table.columns:
        column.no_wrap = True
    notices = []
    for camera in cameras:
        table.add_row(
            escape(printable(camera.camera)),
            Text(printable(camera.state), style=_STATES.get(camera.state, "red")),
            f"{camera.fps:.1f}",
            _ms(camera.sync_error_s),
            _ms(camera.tracking_delay_s),
            str(camera.missed),
            str(camera.shed),
            str(camera.late),
            "-" if camera.waiting is None else str(camera.waiting),
            "-" if camera.optimal is None else f"{100 * camera.optimal:.0f} %",
        )
        unsynchronized = "" if camera.synchronized or camera.state != "live" else "not synchronized"
        problem = camera.message
        if problem and camera.retry_at is not None:
            problem += f"; it is opened again at {_utc(camera.retry_at)}"
        notices += [
            Text(printable(f"{camera.camera}: {text}"), style="yellow")
            for text in (problem, unsynchronized)
            if text
        ]
    return Group(table, *notices)


def _people(people: tuple[PersonNow, ...]) -> RenderableType:
    if not people:
        return Text("no people yet", style="dim")
    table = Table("person", "shown by", "for", "seen by", box=None, header_style="dim", pad_edge=False)
    for person in people:
        label = f"{person.object} {person.name}" if person.name else str(person.object)
        since = "-" if person.since_s is None else f"{person.since_s:.0f} s"
        seen_by = " ".join(person.cameras) or "none"
        cells = [escape(printable(text)) for text in (label, person.camera or "-", since, seen_by)]
        table.add_row(*cells, style="" if person.visible else "dim")
    return table


def _utc(unix_s: float) -> str:
    return datetime.fromtimestamp(unix_s, UTC).strftime("%H:%M:%S UTC")


def _ms(seconds: float | None) -> str:
    return "-" if seconds is None else f"{1000 * seconds:.0f} ms"
