r"""The wire format: one ASCII line per message, readable, and usable with ``nc HOST PORT``.

The server sends first and expects no answer::

    MYVIEW-SYNC 1 fps=25 now=1732159200.000000 pulse=-     greeting: version, rate, server clock, last pulse
    WAIT c0,c1                                             no pulse yet: these have not sent HELLO
    PULSE 0 1732159201.000000                              pulse number, when it was due (server clock)

A client may send, and the server answers::

    HELLO 1 c0                                             ready for pulse 0, under this name
    HELLO 1 c0 last=123 ago=0.52                           has counted to pulse 123, due 0.52 seconds ago
    PING 1732159201.5      PONG 1732159201.500000 1732159201.502000      the time sent, the server clock
    WHO                    CLIENTS c0:0,-:7       the other clients, and the pulses dropped in a row for each
    anything else          ERROR malformed ...                           a code, then a sentence

A server with users requires a login first, over TLS (``login``), and then sends the greeting::

    LOGIN-REQUIRED 1 now=1732159200.000000
    LOGIN c0 <password>    MYVIEW-SYNC 1 fps=25 now=1732159200.250000 pulse=-

All times are unix seconds. ``ago`` is a duration, not a time, so that a difference between the clocks does
not matter. Unknown ``key=value`` words and unknown server lines are ignored, for later versions.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from camsync.messages import (
    ClientLine,
    ClientList,
    ClientsRequest,
    CountedPulse,
    ErrorMessage,
    Greeting,
    Hello,
    ListedClient,
    LoginMessage,
    LoginRequest,
    Ping,
    Pong,
    PulseMessage,
    ServerLine,
    WaitMessage,
)

VERSION = 1
MAX_LINE = 256  # bytes, without the line end
MAX_SERVER_LINE = 32768  # bytes: WAIT and CLIENTS name every camera of a site
_GREETING = "MYVIEW-SYNC"
_LOGIN_REQUIRED = "LOGIN-REQUIRED"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
LAST_PULSE = 2**40
"""Centuries at any camera's rate. Times in clock ticks fit into 64 bits, and the numbers are exact as
floats."""
_NUMBER = re.compile(r"\d{1,13}")
_TIME = re.compile(r"-?\d{1,12}(\.\d{1,20})?")  # seconds
_PASSWORD = re.compile(
    r"[!-~]{1,128}"
)  # printable ASCII without a space, since spaces separate the words of a line
_CODE = re.compile(r"[a-z]{1,20}")
_FPS = re.compile(r"\d{1,6}(\.\d{1,20})?")  # pulses per second; no exponent: people read it
_UNNAMED = "-"  # a client without a name; no valid name
_PASSWORD_SYNTAX = "a password has 1 to 128 printable ASCII characters, none of them a space"  # noqa: S105
_SHOWN = 40  # characters of a wrong word quoted in an error
MIN_FPS, MAX_FPS = 1e-6, 10_000.0  # pulses per second


class ProtocolError(ValueError):
    """A line violates the protocol; ``code`` is that of the ERROR line to answer."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code


def is_name(text: str) -> bool:
    """Return whether ``text`` may name a client: letters, digits, ``.``, ``_``, ``-``; at most 64."""
    return _NAME.fullmatch(text) is not None


def is_password(text: str) -> bool:
    """Return whether ``text`` may be a password: 1 to 128 printable ASCII characters without a space."""
    return _PASSWORD.fullmatch(text) is not None


def encode(message: ClientLine | ServerLine) -> bytes:
    """Encode a message as a line, line end included."""
    text = _client_text(message) if isinstance(message, ClientLine) else _server_text(message)
    return text.encode("ascii", "replace") + b"\n"


def _client_text(message: ClientLine) -> str:
    match message:
        case Hello(name, known):
            counted = "" if known is None else f" last={known.number} ago={known.ago:.6f}"
            return f"HELLO {VERSION} {name}{counted}"
        case Ping(sent):
            return f"PING {sent:.6f}"
        case ClientsRequest():
            return "WHO"
        case LoginMessage(user, password):
            return f"LOGIN {user} {password}"


def _server_text(message: ServerLine) -> str:  # noqa: PLR0911 — one return per message
    match message:
        case LoginRequest(now):
            return f"{_LOGIN_REQUIRED} {VERSION} now={now:.6f}"
        case Greeting(version, fps, now, pulse):
            last = "-" if pulse is None else pulse
            return f"{_GREETING} {version} fps={_plain(fps)} now={now:.6f} pulse={last}"
        case WaitMessage(names):
            return f"WAIT {','.join(names)}"
        case PulseMessage(number, due):
            return f"PULSE {number} {due:.6f}"
        case Pong(sent, now):
            return f"PONG {sent:.6f} {now:.6f}"
        case ClientList(clients):
            return " ".join(
                [
                    "CLIENTS",
                    ",".join(f"{client.name or _UNNAMED}:{client.dropped_in_a_row}" for client in clients),
                ]
            )
        case ErrorMessage(code, text):
            return f"ERROR {code} {text}"


def parse_client_line(line: bytes) -> ClientLine:
    """Parse a line that a client sent, without its line end.

    Raises:
        ProtocolError: the line is none of HELLO, PING, WHO and LOGIN, or its arguments are wrong.
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
            return ClientsRequest()
        case ["LOGIN", user, password]:
            if not is_password(password):
                raise ProtocolError("malformed", _PASSWORD_SYNTAX)
            return LoginMessage(_match(_NAME, user, "name"), password)
        case _:
            raise ProtocolError(
                "malformed", "expected HELLO 1 <name> [last=<pulse> ago=<seconds>], PING <time> or WHO"
            )


def parse_server_line(line: bytes) -> ServerLine | None:
    """Parse a line that the server sent, without its line end; None for a word of a later version.

    Raises:
        ProtocolError: the arguments of a known word are wrong.
    """
    words = _words(line)
    parse = _SERVER_WORDS.get(words[0]) if words else None
    if parse is None:
        return None
    try:
        return parse(words[1:])
    except (ValueError, KeyError) as error:
        raise ProtocolError("malformed", f"{words[0]}: {error}") from error


def _login_request(words: list[str]) -> LoginRequest:
    _match(_NUMBER, words[0] if words else "", "version")
    return LoginRequest(_time(_keys(words[1:])["now"]))


def _greeting(words: list[str]) -> Greeting:
    version = int(_match(_NUMBER, words[0] if words else "", "version"))
    keys = _keys(words[1:])
    if version != VERSION:  # only the version has the same meaning in all versions
        return Greeting(version, 1.0, 0.0, None)
    fps = float(_match(_FPS, keys["fps"], "rate"))
    if not MIN_FPS <= fps <= MAX_FPS:
        raise ProtocolError("malformed", f"the rate is not between {MIN_FPS:g} and {MAX_FPS:g}")
    pulse = None if keys["pulse"] == "-" else _number(keys["pulse"])
    return Greeting(version, fps, _time(keys["now"]), pulse)


def _wait(words: list[str]) -> WaitMessage:
    (names,) = words
    return WaitMessage(tuple(_match(_NAME, name, "name") for name in names.split(",")))


def _pulse(words: list[str]) -> PulseMessage:
    number, due = words
    return PulseMessage(_number(number), _time(due))


def _pong(words: list[str]) -> Pong:
    sent, now = words
    return Pong(_time(sent), _time(now))


def _clients(words: list[str]) -> ClientList:
    return ClientList(tuple(_listed_client(text) for text in "".join(words).split(",") if text))


def _listed_client(text: str) -> ListedClient:
    name, _, dropped = text.partition(":")
    return ListedClient(None if name == _UNNAMED else _match(_NAME, name, "name"), _number(dropped))


def _error(words: list[str]) -> ErrorMessage:
    code, *text = words
    return ErrorMessage(_match(_CODE, code, "code"), " ".join(text))


_SERVER_WORDS: dict[str, Callable[[list[str]], ServerLine]] = {
    _GREETING: _greeting,
    _LOGIN_REQUIRED: _login_request,
    "WAIT": _wait,
    "PULSE": _pulse,
    "PONG": _pong,
    "CLIENTS": _clients,
    "ERROR": _error,
}


def _known(keys: dict[str, str]) -> CountedPulse:
    ago = _time(keys.get("ago", "0"))
    if ago < 0.0:
        raise ProtocolError("malformed", "ago is a duration in seconds, not below zero")
    return CountedPulse(_number(keys["last"]), ago)


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
