"""The served application: what anybody asks, what an operator sends, and what strangers get."""

from __future__ import annotations

from benchmarks.fuzz.http_operator import Operator
from benchmarks.fuzz.http_requests import Requests
from benchmarks.fuzz.http_strangers import Strangers

TARGETS = (Requests, Operator, Strangers)
