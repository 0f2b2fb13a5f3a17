r"""The wire format: one ASCII line per message, readable and writable by hand with ``nc HOST PORT``.

The server speaks first and needs no answer::

    MYVIEW-SYNC 1 fps=25 now=1732159200.000000 pulse=-     greeting: version, rate, server clock, last pulse
    WAIT c0,c1                                             not begun: these have not said HELLO yet
    PULSE 0 1732159201.000000                              pulse number, when it was due (server clock)

A client may say, and the server answers::

    HELLO 1 c0                                             ready for pulse 0, under this name
    HELLO 1 c0 last=123 ago=0.52                           has counted to pulse 123, due 0.52 seconds ago
    PING 1732159201.5      PONG 1732159201.500000 1732159201.502000      its own text, the server clock
    WHO                    CLIENTS c0:0,-:7       who else is there, and how many pulses behind
    anything else          ERROR malformed ...                           a code, then a sentence

A closed server tells nothing to who has not proven to know a password. Its first line is of another version,
so that older clients say so and end; from PROVE on every line is sealed (``seal``) and else as above::

    MYVIEW-SYNC 2 nonce=9f… now=1732159200.000000
    PROVE c0 nonce=41… mac=…
    HELLO 1 c0 mac=…       MYVIEW-SYNC 1 fps=25 now=1732159200.250000 pulse=- mac=…

All times are unix seconds. ``ago`` is a span, not a time, so that it means the same on a server whose clock
differs. Unknown ``key=value`` words and unknown words of the server are passed over: room for later versions.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from camsync.messages import (
    Beat,
    Challenge,
    ClientLine,
    Clients,
    Greeting,
    Hello,
    Known,
    Listener,
    Ping,
    Pong,
    Prove,
    Refusal,
    ServerLine,
    Wait,
    Who,
)

VERSION = 1
CLOSED = 2  # the version of a closed server's first line
MAX_LINE = 256  # bytes, without the line end
MAX_SERVER_LINE = 32768  # bytes: WAIT and CLIENTS name every camera of a site
_GREETING = "MYVIEW-SYNC"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
LAST_PULSE = 2**40
"""Enough for centuries at any camera's rate; times in ticks of a clock stay within 64 bits, numbers exact."""
_NUMBER = re.compile(r"\d{1,13}")
_TIME = re.compile(r"-?\d{1,12}(\.\d{1,20})?")  # seconds
_NONCE = re.compile(r"[0-9a-f]{32}")
_CODE = re.compile(r"[a-z]{1,20}")
_FPS = re.compile(r"\d{1,6}(\.\d{1,20})?")  # pulses per second; no exponent: people read it
_NONCE_IS = "nonce="
_UNNAMED = "-"  # stands for a client without a name, which no name can be
_SHOWN = 40  # characters of a wrong word that an error repeats
MIN_FPS, MAX_FPS = 1e-6, 10_000.0  # pulses per second that a server may have as its rate


class ProtocolError(ValueError):
    """A line is not of this protocol; ``code`` is the first word of the answer."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code


def is_name(text: str) -> bool:
    """Say whether ``text`` may name a client: letters, digits, ``.``, ``_``, ``-``; at most 64."""
    return _NAME.fullmatch(text) is not None


def encode(message: ClientLine | ServerLine) -> bytes:
    """Give the line of a message, line end included."""
    text = _client_text(message) if isinstance(message, ClientLine) else _server_text(message)
    return text.encode("ascii", "replace") + b"\n"


def _client_text(message: ClientLine) -> str:
    match message:
        case Hello(name, known):
            counted = "" if known is None else f" last={known.number} ago={known.ago:.6f}"
            return f"HELLO {VERSION} {name}{counted}"
        case Ping(sent):
            return f"PING {sent:.6f}"
        case Who():
            return "WHO"
        case Prove(user, nonce):
            return f"PROVE {user} {_NONCE_IS}{nonce}"


def _server_text(message: ServerLine) -> str:  # noqa: PLR0911 — one return per message
    match message:
        case Challenge(nonce, now):
            return f"{_GREETING} {CLOSED} {_NONCE_IS}{nonce} now={now:.6f}"
        case Greeting(version, fps, now, pulse):
            last = "-" if pulse is None else pulse
            return f"{_GREETING} {version} fps={_plain(fps)} now={now:.6f} pulse={last}"
        case Wait(names):
            return f"WAIT {','.join(names)}"
        case Beat(number, due):
            return f"PULSE {number} {due:.6f}"
        case Pong(sent, now):
            return f"PONG {sent:.6f} {now:.6f}"
        case Clients(clients):
            return " ".join(["CLIENTS", ",".join(f"{it.name or _UNNAMED}:{it.behind}" for it in clients)])
        case Refusal(code, text):
            return f"ERROR {code} {text}"


def parse_client_line(line: bytes) -> ClientLine:
    """Read a line that a client sent, without its line end.

    Raises:
        ProtocolError: the line is none of HELLO, PING, WHO and PROVE, or its words are wrong.
    """
    match _words(line):
        case ["HELLO", version, name, *rest]:
            if _match(_NUMBER, version, "version") != str(VERSION):
                raise ProtocolError("version", f"this server speaks version {VERSION}, not {version}")
            keys = _keys(rest)
            known = _known(keys) if "last" in keys else None
            return Hello(_match(_NAME, name, "name"), known)
        case ["PING", sent]:
            return Ping(_time(sent))
        case ["WHO"]:
            return Who()
        case ["PROVE", user, nonce, *_] if nonce.startswith(_NONCE_IS):
            return Prove(_match(_NAME, user, "name"), _match(_NONCE, nonce.removeprefix(_NONCE_IS), "nonce"))
        case _:
            raise ProtocolError(
                "malformed", "say HELLO 1 <name> [last=<pulse> ago=<seconds>], PING <time> or WHO"
            )


def parse_server_line(line: bytes) -> ServerLine | None:
    """Read a line that the server sent, without its line end; None for a word of a later version.

    Raises:
        ProtocolError: a known word with wrong words after it.
    """
    words = _words(line)
    read = _SERVER_WORDS.get(words[0]) if words else None
    if read is None:
        return None
    try:
        return read(words[1:])
    except (ValueError, KeyError) as error:
        raise ProtocolError("malformed", f"{words[0]}: {error}") from error


def _greeting(words: list[str]) -> Challenge | Greeting:
    version = int(_match(_NUMBER, words[0] if words else "", "version"))
    keys = _keys(words[1:])
    if version == CLOSED:
        return Challenge(_match(_NONCE, keys["nonce"], "nonce"), _time(keys["now"]))
    if version != VERSION:  # only the version itself is sure to mean the same in all versions
        return Greeting(version, 1.0, 0.0, None)
    fps = float(_match(_FPS, keys["fps"], "rate"))
    if not MIN_FPS <= fps <= MAX_FPS:
        raise ProtocolError("malformed", f"the rate is not between {MIN_FPS:g} and {MAX_FPS:g}")
    pulse = None if keys["pulse"] == "-" else _number(keys["pulse"])
    return Greeting(version, fps, _time(keys["now"]), pulse)


def _wait(words: list[str]) -> Wait:
    (names,) = words
    return Wait(tuple(_match(_NAME, name, "name") for name in names.split(",")))


def _beat(words: list[str]) -> Beat:
    number, due = words
    return Beat(_number(number), _time(due))


def _pong(words: list[str]) -> Pong:
    sent, now = words
    return Pong(_time(sent), _time(now))


def _clients(words: list[str]) -> Clients:
    return Clients(tuple(_listener(it) for it in "".join(words).split(",") if it))


def _listener(text: str) -> Listener:
    name, _, behind = text.partition(":")
    return Listener(None if name == _UNNAMED else _match(_NAME, name, "name"), _number(behind))


def _refusal(words: list[str]) -> Refusal:
    code, *text = words
    return Refusal(_match(_CODE, code, "code"), " ".join(text))


_SERVER_WORDS: dict[str, Callable[[list[str]], ServerLine]] = {
    _GREETING: _greeting,
    "WAIT": _wait,
    "PULSE": _beat,
    "PONG": _pong,
    "CLIENTS": _clients,
    "ERROR": _refusal,
}


def _known(keys: dict[str, str]) -> Known:
    ago = _time(keys.get("ago", "0"))
    if ago < 0.0:
        raise ProtocolError("malformed", "ago is a span in seconds, not below zero")
    return Known(_number(keys["last"]), ago)


def _plain(fps: float) -> str:
    return f"{fps:.12f}".rstrip("0").rstrip(".")


def _words(line: bytes) -> list[str]:
    try:
        return line.decode("ascii").split()
    except UnicodeDecodeError:
        raise ProtocolError("malformed", "lines are ASCII") from None


def _keys(words: list[str]) -> dict[str, str]:
    pairs = (word.partition("=") for word in words)
    return {key: value for key, equals, value in pairs if equals}


def _match(pattern: re.Pattern[str], text: str, what: str) -> str:
    if pattern.fullmatch(text) is None:
        raise ProtocolError("malformed", f"{text[:_SHOWN]!a} is not a {what}")
    return text


def _number(text: str) -> int:
    number = int(_match(_NUMBER, text, "pulse number"))
    if number > LAST_PULSE:
        raise ProtocolError("malformed", f"{number} is beyond the last pulse, {LAST_PULSE}")
    return number


def _time(text: str) -> float:
    return float(_match(_TIME, text, "time in seconds"))
