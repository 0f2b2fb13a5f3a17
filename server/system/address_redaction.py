"""Addresses as they may be shown: the protocol and the host. All else may be a password, or hold one.

Nothing tells a password from a path: some cameras have it there, others behind ``?p=`` or ``?sig=``, and
one with a slash or a space in it ends a login too early. So what is shown is what surely is none.
"""

from __future__ import annotations

import re

HIDDEN = "(not shown)"
_MORE = "..."
"""What stands for the rest of an address."""
_PROTOCOLS = (
    r"amqp|async|bluray|cache|concatf?|crypto|data|dtls|dvd|fd|ffrtmpcrypt|ffrtmphttp|file|ftps?|gophers?|hls|"
    r"https?|httpproxy|icecast|ip[fn]s|md5|mms[htu]?|nfs|onvif|pipe|prompeg|rist|rtmp(?:e|s|t|te|ts)?|rtp|"
    r"rtsp[stu]?|sap|satip|sctp|sdp|sftp|smb|srtp?|subfile|tcp|tee|tls|udp|udplite|unix|webrtc|whip|wss?|zmq"
)
"""What FFmpeg opens, and what people take for it."""
_PROTOCOL = rf"(?:{_PROTOCOLS})(?:[+](?:{_PROTOCOLS}))*"
_OPENED = re.compile(rf"{_PROTOCOL}:|subfile,", re.IGNORECASE)
"""How an address begins where no // follows: ``rtsp:host``, ``concat:a|b``."""
_LOGIN = re.compile(r"(?![./])[^@]*:[^@]*@")
"""An address whose protocol was left out or mistyped: ``name:password@host``, ``rtsp//name:…@host``."""
_IN_PATH = re.compile(rf"(?<=/)(?:{_PROTOCOL}:|[a-z][a-z0-9+.-]+:/(?=.*@))", re.IGNORECASE | re.DOTALL)
"""An address that was taken for a path in a folder, where ``//`` becomes ``/``."""
_ANYWHERE = re.compile(rf"[a-z][a-z0-9+.-]*:/|\b{_PROTOCOL}:(?!\s)", re.IGNORECASE)
_SCHEME = re.compile(r"[a-z][a-z0-9+.-]*(?=://)", re.IGNORECASE)
_PLACE = re.compile(r"(?:\[[0-9a-z:.%_-]+\]|[\w.-]+)(?::[0-9]{1,5})?", re.IGNORECASE)
"""A host, and perhaps a port."""
_ENDPOINT = re.compile(r"[a-z]+/(?:\[[0-9a-z:.%_-]+\]|[\w.*-]+):[0-9]{1,5}(?![^?#])", re.IGNORECASE)


def has_protocol(source: str) -> bool:
    """Return whether FFmpeg would look for a protocol in this, rather than for a file."""
    return "://" in source or _OPENED.match(source) is not None


def is_login(source: str) -> bool:
    """Return whether this looks like a name and a password for a host, though it has no protocol."""
    return _LOGIN.match(source) is not None


def redact_address(source: str) -> str:
    """Return a source, or another address or path, as it may be shown: of an address its protocol and host.

    ``rtsp://name:password@10.0.0.1/live`` is shown as ``rtsp://10.0.0.1/...``. Where an @ stands behind what
    looks like the host, that may be the login's beginning, and is not shown. A path is shown as it is.
    """
    if source.startswith("scene:"):
        return source
    if source.startswith("/") and (match := _IN_PATH.search(source)) is not None:
        return f"{source[: match.start()]}{_MORE}"
    if (match := _SCHEME.match(source)) is not None:
        return f"{match[0]}://{_shown_place(source[match.end() + 3 :])}"
    if (match := _OPENED.match(source)) is not None:
        return f"{match[0][:-1]}:{_MORE}"
    return HIDDEN if "://" in source or is_login(source) else source


def _shown_place(rest: str) -> str:
    """Return host and port of what stands behind ``://``, if they are surely that."""
    authority = re.split(r"[/?#]", rest, maxsplit=1)[0]
    beyond = rest[len(authority) :]
    login, _, place = authority.rpartition("@")
    if "@" in beyond or not _PLACE.fullmatch(place):
        return _MORE
    return f"{place}/{_MORE}" if login or beyond.strip("/") else f"{place}{beyond}"


def redact_endpoint(endpoint: str) -> str:
    """Return zenoh's ``protocol/host:port`` without the settings that may stand behind it: keys, for one."""
    match = _ENDPOINT.match(endpoint)
    if match is None:
        return HIDDEN
    return match[0] if match.end() == len(endpoint) else f"{match[0]} {_MORE}"


def redact_addresses(text: str) -> str:
    """Return others' words, such as a traceback, with each line only up to where an address begins."""
    return "".join(_cut(line) for line in text.splitlines(keepends=True))


def _cut(line: str) -> str:
    match = _ANYWHERE.search(line)
    if match is None:
        return line
    end = "\n" if line.endswith("\n") else ""
    return f"{line[: match.start()]}{_MORE}{end}"


def ffmpeg_reason(error: Exception) -> str:
    """Return FFmpeg's reason by its errno: the error's own text repeats the whole address."""
    return getattr(error, "strerror", None) or "it is no address or path that FFmpeg understands"
