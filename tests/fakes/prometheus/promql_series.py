"""The series that a PromQL expression selects from /metrics: their labels, also by the values of thresholds.

Prometheus reports no error if an expression matches no series: a panel stays empty, an alert never fires.
Here the result is an empty set, and a function that does not fit the kind of metric is an error.
"""

from __future__ import annotations

import operator
from dataclasses import dataclass

import promql_parser as promql
from prometheus_client.parser import text_string_to_metric_families

Series = frozenset[tuple[str, str]]
"""The labels of one series, without its name."""
ADDED_BY_PROMETHEUS = {"job", "instance"}
_KIND_OF = {"rate": "counter", "increase": "counter", "delta": "gauge"}
"""The kind of metric of each function; a histogram's buckets are counters."""
_COMPARISONS = {">": operator.gt, "<": operator.lt, "==": operator.eq}


@dataclass(frozen=True)
class ExportedMetrics:
    """The metrics of one response of /metrics."""

    samples: dict[str, dict[Series, float]]
    """The value of each series, by metric name."""
    kinds: dict[str, str]
    """Counter or gauge, by metric name."""

    @classmethod
    def of(cls, text: str) -> ExportedMetrics:
        samples: dict[str, dict[Series, float]] = {}
        kinds: dict[str, str] = {}
        for family in text_string_to_metric_families(text):
            for sample in family.samples:
                samples.setdefault(sample.name, {})[frozenset(sample.labels.items())] = sample.value
                kinds[sample.name] = "counter" if family.type in {"counter", "histogram"} else family.type
        return cls(samples, kinds)


def selectors(expression: str) -> list[promql.VectorSelector]:
    """Return the selectors of an expression."""
    vector_selectors: list[promql.VectorSelector] = []
    promql.walk(
        promql.parse(expression),
        lambda node: vector_selectors.append(node) if isinstance(node, promql.VectorSelector) else None,
    )
    return vector_selectors


def select_series(expression: str, metrics: ExportedMetrics) -> set[Series]:
    """Return the series of an expression.

    Raises:
        ValueError: it is not supported PromQL, or does not fit the kinds of metrics.
    """
    return _series_of(promql.parse(expression), metrics)


def firing_series(expression: str, metrics: ExportedMetrics) -> set[Series]:
    """Return the series for which an alert's expression of thresholds of gauges holds.

    Raises:
        ValueError: it is another expression.
    """
    return _firing(promql.parse(expression), metrics)


def _firing(node: promql.Expr, metrics: ExportedMetrics) -> set[Series]:
    if isinstance(node, promql.BinaryExpr):
        if str(node.op) == "and":
            return _and(node, _firing(node.lhs, metrics), _firing(node.rhs, metrics))
        if isinstance(node.lhs, promql.VectorSelector) and isinstance(node.rhs, promql.NumberLiteral):
            holds, values = _COMPARISONS[str(node.op)], metrics.samples.get(node.lhs.name or "", {})
            selected = _series_of_selector(node.lhs, metrics)
            return {one_series for one_series in selected if holds(values[one_series], node.rhs.val)}
    raise ValueError(f"not supported: {node.prettify()}")


def _and(node: promql.BinaryExpr, lhs: set[Series], rhs: set[Series]) -> set[Series]:
    """Return the series of one side that the other side has, too, but for ignored labels."""
    matching = None if node.modifier is None else node.modifier.matching
    if matching is not None and matching.type != promql.LabelModifierType.Exclude:
        raise ValueError(f"not supported: {node.modifier}")
    ignored = set() if matching is None else set(matching.labels)

    def matched(one_series: Series) -> Series:
        return frozenset((label, value) for label, value in one_series if label not in ignored)

    others = {matched(one_series) for one_series in rhs}
    return {one_series for one_series in lhs if matched(one_series) in others}


def _series_of(node: promql.Expr, metrics: ExportedMetrics) -> set[Series]:
    match node:
        case promql.ParenExpr():
            return _series_of(node.expr, metrics)
        case promql.VectorSelector():
            return _series_of_selector(node, metrics)
        case promql.MatrixSelector():
            return _series_of_selector(node.vector_selector, metrics)
        case promql.Call():
            return _series_of_call(node, metrics)
        case promql.AggregateExpr():
            return _series_of_aggregate(node, metrics)
        case promql.BinaryExpr():
            return _series_of_binary(node, metrics)
    raise ValueError(f"not supported: {type(node).__name__}")


def _series_of_binary(node: promql.BinaryExpr, metrics: ExportedMetrics) -> set[Series]:
    if str(node.op) == "and":
        return _and(node, _series_of(node.lhs, metrics), _series_of(node.rhs, metrics))
    sides = [side for side in (node.lhs, node.rhs) if not isinstance(side, promql.NumberLiteral)]
    if node.modifier is not None and node.modifier.matching is not None:
        raise ValueError(f"not supported: {node.modifier}")
    return set.intersection(*(_series_of(side, metrics) for side in sides))


def _series_of_selector(node: promql.VectorSelector, metrics: ExportedMetrics) -> set[Series]:
    labels = {
        matcher.name: matcher.value
        for matcher in node.matchers.matchers
        if matcher.name not in ADDED_BY_PROMETHEUS
    }
    if any(matcher.op != promql.MatchOp.Equal for matcher in node.matchers.matchers):
        raise ValueError(f"not supported: {node.prettify()}")
    return {
        label_set
        for label_set in metrics.samples.get(node.name or "", ())
        if labels.items() <= dict(label_set).items()
    }


def _series_of_call(node: promql.Call, metrics: ExportedMetrics) -> set[Series]:
    name = node.func.name
    if name == "histogram_quantile":
        buckets = _series_of(node.args[1], metrics)
        if not all("le" in dict(bucket) for bucket in buckets):
            raise ValueError(f"quantile of a metric without buckets: {node.prettify()}")
        return {frozenset((label, value) for label, value in bucket if label != "le") for bucket in buckets}
    (argument,) = node.args
    if not isinstance(argument, promql.MatrixSelector) or name not in _KIND_OF:
        raise ValueError(f"not supported: {name}")
    metric = argument.vector_selector.name
    kind = metrics.kinds.get(metric, _KIND_OF[name])
    if kind != _KIND_OF[name]:
        raise ValueError(f"{name} of {metric}, which is a {kind}")
    return _series_of(argument, metrics)


def _series_of_aggregate(node: promql.AggregateExpr, metrics: ExportedMetrics) -> set[Series]:
    series = _series_of(node.expr, metrics)
    by = set(node.modifier.labels) if node.modifier is not None else set()
    if node.modifier is not None and node.modifier.type != promql.AggModifierType.By:
        raise ValueError(f"not supported: {node.modifier}")
    if not all(by <= dict(one_series).keys() for one_series in series):
        raise ValueError(f"by missing labels: {node.prettify()}")
    return {frozenset((label, value) for label, value in one_series if label in by) for one_series in series}
