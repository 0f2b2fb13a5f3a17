"""The served application: addresses, parameters and bodies by its own description, and raw bytes."""

from __future__ import annotations

from benchmarks.fuzz_http_requests import Requests

TARGETS = (Requests,)
