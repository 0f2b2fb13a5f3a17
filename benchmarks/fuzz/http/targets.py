"""The served application: what anybody asks, what an operator sends, and what strangers get."""

from __future__ import annotations

from benchmarks.fuzz.http.operator_requests import Operator
from benchmarks.fuzz.http.requests import Requests
from benchmarks.fuzz.http.unauthenticated import Strangers

TARGETS = (Requests, Operator, Strangers)
