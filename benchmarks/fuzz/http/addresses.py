"""The application's addresses, with valid, nearly valid or odd values."""

from __future__ import annotations

from random import Random
from urllib.parse import quote

from benchmarks.fuzz.engine.mutations import mutate_bytes, odd

WORDS = (
    b"\r\n", b"\n", b"\r", b"\x00", b"\xff", b" ", b"%", b"%00", b"%2e%2e%2f", b"../", b"/..//", b"%ff",
    b"%ud800", b"?", b"&", b"=", b"#", b";", b":", b"\xc3\xa9", b"Content-Length: 9999999\r\n",
    b"Content-Length: -1\r\n", b"Transfer-Encoding: chunked\r\n", b"ffffffffffffffff\r\n",
    b"Expect: 100-continue\r\n", b"Range: bytes=9-1\r\n", b"HTTP/9.9", b"HTTP/1.0", b"CONNECT ",
    b"A" * 9000, b"0" * 5000, b"Cookie: a=b; =\x01\r\n", b"Host: \r\n",
)  # fmt: skip
_MOMENTS = (
    "-60", "p5", "p0", "p9999999999999", "-0", "-999999999", "2026-11-21T16:13:36Z",
    "0001-01-01T00:00:00+23:59", "9999-12-31T23:59:59-23:59", "2026-11-21", "now", "-1e9", "p-1", "",
)  # fmt: skip
METHODS = ("GET",) * 12 + ("HEAD", "POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "get", "X")
_RANGES = (
    "0-", "-1", "5-2", "0-0", "0-0,2-3", "-", "999999999999-", "0-99999999999999999999", "-0", "1-2-3",
    "x-y", "0-" + ",0-" * 300,
)  # fmt: skip
_NAMES = {
    "object": ("1", "2", "99", "0", "00001", "-1", "999999999", "1e3", "x", "%31"),
    "camera": ("c0", "c1", "c9", "c%30", "..", "%2e%2e", "c0%00", "*"),
    "segment": ("0", "1", "2", "9999999999", "-1", "x"),
    "part": ("0", "1", "99", "-1", "x"),
    "name": ("x", "..", "session.json"),
}


def address(rng: Random, path: str, queries: tuple[str, ...]) -> str:
    """Fill an address pattern, and add some query parameters."""
    for name, values in _NAMES.items():
        while "{" + name + "}" in path:
            value = rng.choice(values) if rng.random() < 0.8 else quote(str(odd(rng)), errors="replace")[:300]
            path = path.replace("{" + name + "}", value, 1)
    parameters = [f"{query}={_value(rng, query)}" for query in queries if rng.random() < 0.5]
    if rng.random() < 0.1:
        name = rng.choice(("overlay", "from", "prefer", "x"))
        parameters.append(f"{name}={quote(str(odd(rng)), errors='replace')[:200]}")
    parameters = [parameter for parameter in parameters if parameter != "overlay=1" or rng.random() < 0.01]
    return f"{path}{'?' + '&'.join(parameters) if parameters else ''}"


def some_range(rng: Random) -> str:
    """Return a Range header."""
    return f"Range: {rng.choice(('bytes', 'bytes', 'items', ''))}={rng.choice(_RANGES)}"


def _value(rng: Random, name: str) -> str:
    if name in {"from", "to", "at"}:
        return _moment(rng)
    if name in {"camera", "prefer"}:
        return rng.choice(_NAMES["camera"])
    if rng.random() < 0.5:
        return str(rng.choice((0, 1, 2, 5, -1, 10**12)))
    return quote(str(odd(rng)), errors="replace")[:200]


def _moment(rng: Random) -> str:
    """Return a time: recorded, far away, or invalid."""
    kind = rng.random()
    if kind < 0.5:
        return quote(rng.choice(_MOMENTS), safe="+")
    if kind < 0.8:
        return f"p{rng.randrange(-3, 40)}"
    damaged = mutate_bytes(rng, rng.choice(_MOMENTS).encode(), WORDS)
    return quote(damaged, safe="+")[:300]
