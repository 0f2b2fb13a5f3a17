"""Parsing ``/metrics``: values by name and labels."""

from __future__ import annotations

import math

from prometheus_client.parser import text_string_to_metric_families

from client.http import ContractError
from client.status.model import ServiceNow


class Metrics:
    """The samples of one response.

    Raises:
        ContractError: the text is not in Prometheus' format.
    """

    def __init__(self, text: str) -> None:
        self._values: dict[tuple[str, frozenset[tuple[str, str]]], float] = {}
        try:
            for family in text_string_to_metric_families(text):
                for sample in family.samples:
                    if not math.isfinite(sample.value):
                        continue  # MyView exports none
                    self._values[sample.name, frozenset(sample.labels.items())] = sample.value
        except ValueError as error:
            raise ContractError(f"/metrics is not understood: {error}") from error

    def get(self, name: str, **labels: str) -> float | None:
        """Return a value; None if it is missing."""
        return self._values.get((name, frozenset(labels.items())))

    def count(self, name: str, **labels: str) -> int:
        """Return an integer; 0 if it is missing."""
        return int(self.get(name, **labels) or 0)

    def by(self, name: str, label: str) -> dict[str, int]:
        """Return integers by the value of a label."""
        return {
            dict(labels)[label]: int(value)
            for (known, labels), value in self._values.items()
            if known == name and label in dict(labels)
        }

    def mean(self, name: str, **labels: str) -> float | None:
        """Return the mean of a histogram; None if it is empty."""
        count = self.get(f"{name}_count", **labels)
        return (self.get(f"{name}_sum", **labels) or 0.0) / count if count else None

    def share(self, part: str, whole: str, **labels: str) -> float | None:
        """Return the quotient of two counters; None if the whole is 0 or missing."""
        of = self.get(whole, **labels)
        return (self.get(part, **labels) or 0.0) / of if of else None


def service_of(metrics: Metrics) -> ServiceNow:
    """Return the status of the service."""
    return ServiceNow(
        began=metrics.get("process_start_time_seconds") or 0.0,
        viewers=metrics.by("myview_viewers_by_kind", "kind"),
        recording=bool(metrics.get("myview_recording")),
        recorded_bytes=metrics.count("myview_recorded_bytes"),
        decided_pulse=metrics.count("myview_decided_pulse"),
        delay_s=metrics.mean("myview_delay_seconds"),
        lag_s=metrics.mean("myview_loop_lag_seconds"),
        waiting=metrics.by("myview_waiting", "queue"),
        sent_bytes=sum(metrics.by("myview_sent_bytes_total", "of").values()),
        cpu_s=metrics.get("process_cpu_seconds_total") or 0.0,
        memory_bytes=metrics.count("process_resident_memory_bytes"),
    )
