"""What the files for Prometheus and Grafana ask for."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import yaml

from fakes.paths import CONFIGS
from fakes.prometheus.promql_series import GIVEN_BY_PROMETHEUS

RULES: Any = yaml.safe_load((CONFIGS / "prometheus" / "alerts.yml").read_text(encoding="utf-8"))
SCRAPING: Any = yaml.safe_load((CONFIGS / "prometheus" / "prometheus.yml").read_text(encoding="utf-8"))
DASHBOARD: Any = json.loads((CONFIGS / "grafana" / "myview.json").read_text(encoding="utf-8"))
ALERTS: list[dict[str, Any]] = [rule for group in RULES["groups"] for rule in group["rules"]]
PANELS: list[dict[str, Any]] = [panel for panel in DASHBOARD["panels"] if panel["type"] != "row"]
VARIABLES: list[dict[str, Any]] = DASHBOARD["templating"]["list"]
OF_PROMETHEUS = {"up"}
"""Metrics that are about a service, not of it."""


@dataclass(frozen=True)
class Asked:
    """One expression."""

    place: str
    expression: str
    """With the dashboard's variables filled in."""
    shown: frozenset[str]
    """The labels that are put into words beside what it gives."""


def filled(expression: str) -> str:
    """Fill the dashboard's variables in."""
    return expression.replace("$__rate_interval", "1m").replace("$job", "myview")


def _all() -> Iterator[Asked]:
    for alert in ALERTS:
        shown = set(re.findall(r"\$labels\.(\w+)", alert["annotations"]["summary"]))
        place = f"alert {alert['alert']}"
        yield Asked(place, alert["expr"], frozenset(shown - GIVEN_BY_PROMETHEUS))
    for panel in PANELS:
        for target in panel["targets"]:
            shown = set(re.findall(r"\{\{(\w+)\}\}", target["legendFormat"]))
            place = f"panel {panel['title']} {target['refId']}"
            yield Asked(place, filled(target["expr"]), frozenset(shown))
    for variable in VARIABLES:
        if variable["type"] == "query":
            (metric,) = re.findall(r"^label_values\((\w+), \w+\)$", variable["query"]["query"])
            yield Asked(f"variable {variable['name']}", metric, frozenset())


ASKED = tuple(_all())
"""Every expression of the dashboard and of the alerts."""
