"""Which series a PromQL expression gives from one answer of /metrics: their labels, never their values.

Prometheus says nothing where an expression fits no series: a panel stays empty and an alert never fires. Here
that is an empty set, and what makes no sense for the kind of metric is an error.
"""

from __future__ import annotations

from dataclasses import dataclass

import promql_parser as promql
from prometheus_client.parser import text_string_to_metric_families

Series = frozenset[tuple[str, str]]
"""The labels of one series, without its name."""
GIVEN_BY_PROMETHEUS = {"job", "instance"}
_KIND_OF = {"rate": "counter", "increase": "counter", "delta": "gauge"}
"""What a function is for. A histogram's buckets are counters."""


@dataclass(frozen=True)
class Printed:
    """What /metrics printed."""

    samples: dict[str, set[Series]]
    """By their names."""
    kinds: dict[str, str]
    """counter or gauge, by the same names."""

    @classmethod
    def of(cls, text: str) -> Printed:
        samples: dict[str, set[Series]] = {}
        kinds: dict[str, str] = {}
        for family in text_string_to_metric_families(text):
            for sample in family.samples:
                samples.setdefault(sample.name, set()).add(frozenset(sample.labels.items()))
                kinds[sample.name] = "counter" if family.type in {"counter", "histogram"} else family.type
        return cls(samples, kinds)


def selectors(expression: str) -> list[promql.VectorSelector]:
    """List what an expression asks for, whatever it makes of it."""
    found: list[promql.VectorSelector] = []
    promql.walk(
        promql.parse(expression),
        lambda node: found.append(node) if isinstance(node, promql.VectorSelector) else None,
    )
    return found


def given(expression: str, printed: Printed) -> set[Series]:
    """Return the series of an expression.

    Raises:
        ValueError: it is no PromQL, or makes no sense for these metrics.
    """
    return _given(promql.parse(expression), printed)


def _given(node: promql.Expr, printed: Printed) -> set[Series]:
    match node:
        case promql.ParenExpr():
            return _given(node.expr, printed)
        case promql.VectorSelector():
            return _selected(node, printed)
        case promql.MatrixSelector():
            return _selected(node.vector_selector, printed)
        case promql.Call():
            return _called(node, printed)
        case promql.AggregateExpr():
            return _summed(node, printed)
        case promql.BinaryExpr():
            sides = [side for side in (node.lhs, node.rhs) if not isinstance(side, promql.NumberLiteral)]
            if node.modifier is not None and node.modifier.matching is not None:
                raise ValueError(f"not known here: {node.modifier}")
            return set.intersection(*(_given(side, printed) for side in sides))
    raise ValueError(f"not known here: {type(node).__name__}")


def _selected(node: promql.VectorSelector, printed: Printed) -> set[Series]:
    wanted = {
        matcher.name: matcher.value
        for matcher in node.matchers.matchers
        if matcher.name not in GIVEN_BY_PROMETHEUS
    }
    if any(matcher.op != promql.MatchOp.Equal for matcher in node.matchers.matchers):
        raise ValueError(f"not known here: {node.prettify()}")
    return {
        label_set
        for label_set in printed.samples.get(node.name or "", ())
        if wanted.items() <= dict(label_set).items()
    }


def _called(node: promql.Call, printed: Printed) -> set[Series]:
    name = node.func.name
    if name == "histogram_quantile":
        buckets = _given(node.args[1], printed)
        if not all("le" in dict(bucket) for bucket in buckets):
            raise ValueError(f"a quantile of what has no buckets: {node.prettify()}")
        return {frozenset((label, value) for label, value in bucket if label != "le") for bucket in buckets}
    (over,) = node.args
    if not isinstance(over, promql.MatrixSelector) or name not in _KIND_OF:
        raise ValueError(f"not known here: {name}")
    metric = over.vector_selector.name
    kind = printed.kinds.get(metric, _KIND_OF[name])
    if kind != _KIND_OF[name]:
        raise ValueError(f"{name} of {metric}, which is a {kind}")
    return _given(over, printed)


def _summed(node: promql.AggregateExpr, printed: Printed) -> set[Series]:
    series = _given(node.expr, printed)
    by = set(node.modifier.labels) if node.modifier is not None else set()
    if node.modifier is not None and node.modifier.type != promql.AggModifierType.By:
        raise ValueError(f"not known here: {node.modifier}")
    if not all(by <= dict(one_series).keys() for one_series in series):
        raise ValueError(f"by labels that there are not: {node.prettify()}")
    return {frozenset((label, value) for label, value in one_series if label in by) for one_series in series}
