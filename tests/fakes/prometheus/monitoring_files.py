"""The expressions in the files for Prometheus and Grafana."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import yaml

from fakes.paths import CONFIGS
from fakes.prometheus.promql_series import ADDED_BY_PROMETHEUS

RULES: Any = yaml.safe_load((CONFIGS / "prometheus" / "alerts.yml").read_text(encoding="utf-8"))
SCRAPING: Any = yaml.safe_load((CONFIGS / "prometheus" / "prometheus.yml").read_text(encoding="utf-8"))
DASHBOARD: Any = json.loads((CONFIGS / "grafana" / "myview.json").read_text(encoding="utf-8"))
ALERTS: list[dict[str, Any]] = [rule for group in RULES["groups"] for rule in group["rules"]]
PANELS: list[dict[str, Any]] = [panel for panel in DASHBOARD["panels"] if panel["type"] != "row"]
VARIABLES: list[dict[str, Any]] = DASHBOARD["templating"]["list"]
BUILT_IN_METRICS = {"up"}
"""Metrics that Prometheus itself adds."""


@dataclass(frozen=True)
class MonitoringExpression:
    """An expression of the dashboard or of an alert."""

    place: str
    expression: str
    """With the dashboard's variables replaced."""
    shown: frozenset[str]
    """The labels shown in its legend or summary."""


def replace_variables(expression: str) -> str:
    """Replace the dashboard's variables."""
    return expression.replace("$__rate_interval", "1m").replace("$job", "myview")


def _all() -> Iterator[MonitoringExpression]:
    for alert in ALERTS:
        shown = set(re.findall(r"\$labels\.(\w+)", alert["annotations"]["summary"]))
        place = f"alert {alert['alert']}"
        yield MonitoringExpression(place, alert["expr"], frozenset(shown - ADDED_BY_PROMETHEUS))
    for panel in PANELS:
        for target in panel["targets"]:
            shown = set(re.findall(r"\{\{(\w+)\}\}", target["legendFormat"]))
            place = f"panel {panel['title']} {target['refId']}"
            yield MonitoringExpression(place, replace_variables(target["expr"]), frozenset(shown))
    for variable in VARIABLES:
        if variable["type"] == "query":
            (metric,) = re.findall(r"^label_values\((\w+), \w+\)$", variable["query"]["query"])
            yield MonitoringExpression(f"variable {variable['name']}", metric, frozenset())


EXPRESSIONS = tuple(_all())
"""All expressions of the dashboard and of the alerts."""
