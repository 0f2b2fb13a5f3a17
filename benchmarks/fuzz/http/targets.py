"""The targets of the served application: anonymous, operator and unauthenticated requests."""

from __future__ import annotations

from benchmarks.fuzz.http.operator_requests import OperatorRequests
from benchmarks.fuzz.http.requests import AnonymousRequests
from benchmarks.fuzz.http.unauthenticated import UnauthenticatedRequests

TARGETS = (AnonymousRequests, OperatorRequests, UnauthenticatedRequests)
