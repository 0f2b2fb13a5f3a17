"""The files for Prometheus and Grafana ask for nothing that /metrics does not say."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import promql_parser as promql
import pytest
import yaml
from cameras_by_hand import CAMERAS, status, tracks, word
from halls import Hall
from prometheus_client.parser import text_string_to_metric_families

CONFIGS = Path(__file__).parents[2] / "configs"
RULES: Any = yaml.safe_load((CONFIGS / "prometheus" / "alerts.yml").read_text(encoding="utf-8"))
SCRAPING: Any = yaml.safe_load((CONFIGS / "prometheus" / "prometheus.yml").read_text(encoding="utf-8"))
DASHBOARD: Any = json.loads((CONFIGS / "grafana" / "myview.json").read_text(encoding="utf-8"))
ALERTS: list[dict[str, Any]] = [rule for group in RULES["groups"] for rule in group["rules"]]
PANELS: list[dict[str, Any]] = [panel for panel in DASHBOARD["panels"] if panel["type"] != "row"]
OF_PROMETHEUS = {"up"}
"""Metrics that are about a service, not of it."""
GIVEN_BY_PROMETHEUS = {"job", "instance"}
SEVERITIES = {"critical", "warning", "info"}


@dataclass(frozen=True)
class Asked:
    """What an expression asks for: a metric, and values that its labels must have."""

    metric: str
    labels: dict[str, str]


def asked(expression: str) -> list[Asked]:
    """List what a PromQL expression asks for, with the dashboard's variables filled in."""
    found: list[Asked] = []

    def visit(node: promql.Expr) -> None:
        if isinstance(node, promql.VectorSelector):
            equal = [it for it in node.matchers.matchers if it.op == promql.MatchOp.Equal]
            labels = {it.name: it.value for it in equal if it.name not in GIVEN_BY_PROMETHEUS}
            found.append(Asked(node.name or "", labels))

    filled = expression.replace("$__rate_interval", "1m").replace("$job", "myview")
    promql.walk(promql.parse(filled), visit)
    return found


def expressions() -> Iterator[tuple[str, str]]:
    """Give every expression of both files by its place."""
    for alert in ALERTS:
        yield f"alert {alert['alert']}", alert["expr"]
    for panel in PANELS:
        for target in panel["targets"]:
            yield f"panel {panel['title']} {target['refId']}", target["expr"]


EXPRESSIONS = list(expressions())


async def printed(hall: Hall) -> dict[str, list[dict[str, str]]]:
    """Give the labels of every sample that /metrics prints, by its name."""
    for camera in CAMERAS:
        hall.service.intake.status(status(camera))
        hall.service.intake.tracks(tracks(word(camera, 2, {}, solved_at=1.0)))
    found: dict[str, list[dict[str, str]]] = {}
    async with hall.session.get("/metrics") as answer:
        assert answer.status == 200
        families = text_string_to_metric_families(await answer.text())
    for sample in (it for family in families for it in family.samples):
        found.setdefault(sample.name, []).append(sample.labels)
    return found


async def test_whatever_is_asked_for_is_printed(busy: Hall) -> None:
    samples = await printed(busy)
    assert len(EXPRESSIONS) > 50
    for place, expression in EXPRESSIONS:
        questions = asked(expression)
        assert questions, place
        for question in questions:
            if question.metric in OF_PROMETHEUS:
                continue
            assert question.metric in samples, f"{place}: {question.metric}"
            assert any(question.labels.items() <= it.items() for it in samples[question.metric]), place


async def test_whatever_is_printed_can_be_looked_at(busy: Hall) -> None:
    shown = {it.metric for panel in PANELS for t in panel["targets"] for it in asked(t["expr"])}
    shown |= {it.metric for alert in ALERTS for it in asked(alert["expr"])}
    for name in await printed(busy):
        if name.startswith("myview_") and not name.endswith(("_created", "_sum", "_count")):
            assert name in shown or name in _LOOKED_AT_OTHERWISE, name


_LOOKED_AT_OTHERWISE = {
    "myview_decided_pulse",  # by its difference to the pulse, which is the delay
    "myview_recorded_gops_total",  # by its bytes
    "myview_config_differs",  # on the operator's page
}


async def test_labels_that_are_shown_are_there(busy: Hall) -> None:
    samples = await printed(busy)
    for panel in PANELS:
        for target in panel["targets"]:
            shown = set(re.findall(r"\{\{(\w+)\}\}", target["legendFormat"]))
            metrics = [it.metric for it in asked(target["expr"])]
            assert all(shown <= set(samples[metric][0]) for metric in metrics), target
    for alert in ALERTS:
        shown = set(re.findall(r"\$labels\.(\w+)", alert["annotations"]["summary"])) - GIVEN_BY_PROMETHEUS
        metrics = [it.metric for it in asked(alert["expr"]) if it.metric not in OF_PROMETHEUS]
        assert all(shown <= set(samples[metric][0]) for metric in metrics), alert["alert"]


def test_an_expression_that_asks_for_something_else_would_be_noticed() -> None:
    assert asked('rate(myview_x_total{job="$job",stage="take"}[$__rate_interval])') == [
        Asked("myview_x_total", {"stage": "take"})
    ]
    assert [it.metric for it in asked("sum(a) / on (camera) b > 2")] == ["a", "b"]
    with pytest.raises(ValueError, match=r"."):
        asked("rate(myview_x_total[5m)")


def test_every_alert_says_how_bad_it_is_and_has_a_name_of_its_own() -> None:
    names = [alert["alert"] for alert in ALERTS]
    assert len(names) == len(set(names)) > 10
    for alert in ALERTS:
        assert alert["labels"]["severity"] in SEVERITIES
        assert len(alert["annotations"]["summary"]) > 20


def test_prometheus_reads_the_alerts_and_the_page_of_the_demo() -> None:
    assert [(CONFIGS / "prometheus" / name).is_file() for name in SCRAPING["rule_files"]] == [True]
    (job,) = SCRAPING["scrape_configs"]
    assert job["job_name"] == DASHBOARD["templating"]["list"][1]["current"]["value"] == "myview"
    assert job["static_configs"] == [{"targets": ["127.0.0.1:8080"]}]


def test_panels_have_their_own_places() -> None:
    covered: set[tuple[int, int]] = set()
    for panel in DASHBOARD["panels"]:
        at = panel["gridPos"]
        cells = {(at["x"] + x, at["y"] + y) for x in range(at["w"]) for y in range(at["h"])}
        assert not cells & covered, panel["title"]
        assert max(x for x, _ in cells) < 24
        covered |= cells
    assert len({panel["id"] for panel in DASHBOARD["panels"]}) == len(DASHBOARD["panels"])
