"""The files for Prometheus and Grafana use only metrics that exist."""

from __future__ import annotations

import pytest

from fakes.paths import CONFIGS
from fakes.prometheus.monitoring_files import (
    ALERTS,
    BUILT_IN_METRICS,
    DASHBOARD,
    EXPRESSIONS,
    SCRAPING,
    VARIABLES,
)
from fakes.prometheus.promql_series import ExportedMetrics, firing_series, select_series, selectors
from fakes.service.fed_site import ServedSite
from fakes.service.scripted_cameras import CAMERAS, camera_tracks, lost_source, status, tracks
from server.config.sections import LinkSettings
from server.service.other_sites.linked_site import LinkedSite

SEVERITIES = {"critical", "warning", "info"}


async def printed(served: ServedSite) -> ExportedMetrics:
    """Return the metrics of a site in which all of them have values."""
    served.service.joint.offsets = dict.fromkeys(CAMERAS, 0.1)
    link = LinkSettings(connect="tcp/127.0.0.1:1", url="http://yard/")
    served.service.other_sites.sites["yard"] = LinkedSite("yard", link)
    for camera in CAMERAS:
        served.service.ingest.receive_tracks(tracks(camera_tracks(camera, 2, {}, solved_at=1.0)))
        lost = lost_source("Connection refused", 60.0)
        served.service.ingest.receive_status(status(camera, state="away", unavailable=lost))
    async with served.session.get("/metrics") as answer:
        assert answer.status == 200
        return ExportedMetrics.of(await answer.text())


async def test_every_expression_yields_series_with_the_labels_in_its_legend(
    site_with_people: ServedSite,
) -> None:
    metrics = await printed(site_with_people)
    assert len(EXPRESSIONS) > 50
    for query in EXPRESSIONS:
        if {selector.name for selector in selectors(query.expression)} <= BUILT_IN_METRICS:
            continue
        series = select_series(query.expression, metrics)
        assert series, query.place
        assert all(query.shown <= dict(labels).keys() for labels in series), query.place


async def test_every_exported_metric_is_used_by_a_panel_or_alert(site_with_people: ServedSite) -> None:
    looked_at = {selector.name for query in EXPRESSIONS for selector in selectors(query.expression)}
    for name in (await printed(site_with_people)).samples:
        if name.startswith("myview_") and not name.endswith(("_created", "_sum", "_count")):
            assert name in looked_at or name in _LOOKED_AT_OTHERWISE, name


_LOOKED_AT_OTHERWISE = {
    "myview_decided_pulse",  # by its difference to the pulse, which is the delay
    "myview_recorded_gops_total",  # by its bytes
    "myview_config_differs",  # on the operator's page
}

SAID = """# TYPE a_total counter
a_total{camera="c0",of="video"} 1
a_total{camera="c1",of="video"} 1
# TYPE b gauge
b{camera="c1"} 1
b{camera="c2"} 1
# TYPE h histogram
h_bucket{camera="c0",le="1"} 1
h_bucket{camera="c0",le="+Inf"} 1
"""


@pytest.mark.parametrize(
    ("expression", "series"),
    [
        ('rate(a_total{job="x",camera="c0"}[5m])', [{"camera": "c0", "of": "video"}]),
        ("2 * b > 1", [{"camera": "c1"}, {"camera": "c2"}]),
        ("sum(b)", [{}]),
        ("sum(c)", []),
        ("c == 0", []),
        ('b{camera="c7"}', []),
        ("sum by (camera) (rate(a_total[5m])) / b", [{"camera": "c1"}]),
        ('b and ignoring (of) a_total{of="video"} > 0', [{"camera": "c1"}]),
        ("rate(a_total[5m]) / b", []),
        ("histogram_quantile(0.5, sum by (le) (rate(h_bucket[5m])))", [{}]),
        ("histogram_quantile(0.5, rate(h_bucket[5m]))", [{"camera": "c0"}]),
    ],
)
def test_the_evaluator_yields_known_results(expression: str, series: list[dict[str, str]]) -> None:
    assert select_series(expression, ExportedMetrics.of(SAID)) == {
        frozenset(labels.items()) for labels in series
    }


@pytest.mark.parametrize(
    ("expression", "error"),
    [
        ("rate(b[5m])", "rate of b, which is a gauge"),
        ("delta(a_total[5m])", "delta of a_total, which is a counter"),
        ("sum by (object) (b)", "by missing labels"),
        ("histogram_quantile(0.5, b)", "quantile of a metric without buckets"),
        ("rate(a_total[5m)", "."),
    ],
)
def test_the_evaluator_reports_invalid_expressions(expression: str, error: str) -> None:
    with pytest.raises(ValueError, match=error):
        select_series(expression, ExportedMetrics.of(SAID))


@pytest.mark.parametrize(
    ("condition", "covered_share", "alerts"),
    [
        ("clear", 0.0, []),
        ("clear", 0.3, ["MyViewCameraPartlyCovered"]),
        ("covered", 0.6, ["MyViewCameraPicture"]),
        ("covered", 1.0, ["MyViewCameraPicture"]),
    ],
)
async def test_a_covered_lens_fires_one_alert(
    site_with_people: ServedSite, condition: str, covered_share: float, alerts: list[str]
) -> None:
    site_with_people.service.ingest.receive_status(
        status(CAMERAS[0], condition=condition, covered_share=covered_share)
    )
    site_with_people.service.ingest.receive_status(status(CAMERAS[1]))
    async with site_with_people.session.get("/metrics") as answer:
        metrics = ExportedMetrics.of(await answer.text())
    firing = {
        alert["alert"]: [dict(labels)["camera"] for labels in firing_series(alert["expr"], metrics)]
        for alert in ALERTS
        if alert["alert"] in {"MyViewCameraPicture", "MyViewCameraPartlyCovered"}
    }
    assert {name: cameras for name, cameras in firing.items() if cameras} == {
        name: [CAMERAS[0]] for name in alerts
    }


def test_every_alert_has_a_severity_and_a_unique_name() -> None:
    names = [alert["alert"] for alert in ALERTS]
    assert len(names) == len(set(names)) > 10
    for alert in ALERTS:
        assert alert["labels"]["severity"] in SEVERITIES
        assert len(alert["annotations"]["summary"]) > 20


def test_prometheus_scrapes_the_demo_and_loads_the_alert_rules() -> None:
    assert [(CONFIGS / "prometheus" / name).is_file() for name in SCRAPING["rule_files"]] == [True]
    (job,) = SCRAPING["scrape_configs"]
    assert job["job_name"] == VARIABLES[1]["current"]["value"] == "myview"
    assert job["static_configs"] == [{"targets": ["127.0.0.1:8080"]}]


def test_panels_do_not_overlap() -> None:
    covered: set[tuple[int, int]] = set()
    for panel in DASHBOARD["panels"]:
        at = panel["gridPos"]
        cells = {(at["x"] + x, at["y"] + y) for x in range(at["w"]) for y in range(at["h"])}
        assert not cells & covered, panel["title"]
        assert max(x for x, _ in cells) < 24
        covered |= cells
    assert len({panel["id"] for panel in DASHBOARD["panels"]}) == len(DASHBOARD["panels"])
