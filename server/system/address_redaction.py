"""Redaction of addresses: only protocol and host are shown, since everything else may contain a password.

Some cameras have the password in the path, others in ``?p=`` or ``?sig=``, and one with a slash or a space
ends the user information too early. So only parts that cannot be a password are shown.
"""

from __future__ import annotations

import re

from server.system.errors import UserError, reason_of

HIDDEN = "(not shown)"
_MORE = "..."
"""Replaces the hidden part of an address."""
_PROTOCOLS = (
    r"amqp|async|bluray|cache|concatf?|crypto|data|dtls|dvd|fd|ffrtmpcrypt|ffrtmphttp|file|ftps?|gophers?|hls|"
    r"https?|httpproxy|icecast|ip[fn]s|md5|mms[htu]?|nfs|onvif|pipe|prompeg|rist|rtmp(?:e|s|t|te|ts)?|rtp|"
    r"rtsp[stu]?|sap|satip|sctp|sdp|sftp|smb|srtp?|subfile|tcp|tee|tls|udp|udplite|unix|webrtc|whip|wss?|zmq"
)
"""Protocols of FFmpeg, and similar ones that users may enter."""
_PROTOCOL = rf"(?:{_PROTOCOLS})(?:[+](?:{_PROTOCOLS}))*"
_OPENED = re.compile(rf"{_PROTOCOL}:|subfile,", re.IGNORECASE)
"""The start of an address without //: ``rtsp:host``, ``concat:a|b``."""
_LOGIN = re.compile(r"(?![./])[^@]*:[^@]*@")
"""An address whose protocol is missing or mistyped: ``name:password@host``, ``rtsp//name:…@host``."""
_IN_PATH = re.compile(rf"(?<=/)(?:{_PROTOCOL}:|[a-z][a-z0-9+.-]+:/(?=.*@))", re.IGNORECASE | re.DOTALL)
"""An address that was resolved like a path, in which ``//`` became ``/``."""
_ANYWHERE = re.compile(rf"[a-z][a-z0-9+.-]*:/|\b{_PROTOCOL}:(?!\s)", re.IGNORECASE)
_SCHEME = re.compile(r"[a-z][a-z0-9+.-]*(?=://)", re.IGNORECASE)
_PLACE = re.compile(r"(?:\[[0-9a-z:.%_-]+\]|[\w.-]+)(?::[0-9]{1,5})?", re.IGNORECASE)
"""A host, with an optional port."""
_ENDPOINT = re.compile(r"[a-z]+/(?:\[[0-9a-z:.%_-]+\]|[\w.*-]+):[0-9]{1,5}(?![^?#])", re.IGNORECASE)


def has_protocol(source: str) -> bool:
    """Return whether FFmpeg takes a source for an address rather than a file."""
    return "://" in source or _OPENED.match(source) is not None


def looks_like_login(source: str) -> bool:
    """Return whether a source without a protocol looks like ``name:password@host``."""
    return _LOGIN.match(source) is not None


def redact_to_host(source: str) -> str:
    """Return a source, address or path without secrets: only protocol and host of an address.

    ``rtsp://name:password@10.0.0.1/live`` becomes ``rtsp://10.0.0.1/...``. If an @ follows the apparent host,
    that may be part of a name or password, and is hidden. A path is unchanged.
    """
    if source.startswith("scene:"):
        return source
    if source.startswith("/") and (match := _IN_PATH.search(source)) is not None:
        return f"{source[: match.start()]}{_MORE}"
    if (match := _SCHEME.match(source)) is not None:
        return f"{match[0]}://{_host_and_port(source[match.end() + 3 :])}"
    if (match := _OPENED.match(source)) is not None:
        return f"{match[0][:-1]}:{_MORE}"
    return HIDDEN if "://" in source or looks_like_login(source) else source


def _host_and_port(after_scheme: str) -> str:
    """Return host and port of an address, given the part after ``://``, if they cannot be a password."""
    authority = re.split(r"[/?#]", after_scheme, maxsplit=1)[0]
    beyond = after_scheme[len(authority) :]
    login, _, place = authority.rpartition("@")
    if "@" in beyond or not _PLACE.fullmatch(place):
        return _MORE
    return f"{place}/{_MORE}" if login or beyond.strip("/") else f"{place}{beyond}"


def redact_zenoh_endpoint(endpoint: str) -> str:
    """Return a zenoh endpoint ``protocol/host:port`` without its options, which may contain keys."""
    match = _ENDPOINT.match(endpoint)
    if match is None:
        return HIDDEN
    return match[0] if match.end() == len(endpoint) else f"{match[0]} {_MORE}"


def cut_at_addresses(text: str) -> str:
    """Return a text, such as a traceback, with each line cut where an address begins."""
    return "".join(_cut(line) for line in text.splitlines(keepends=True))


def _cut(line: str) -> str:
    match = _ANYWHERE.search(line)
    if match is None:
        return line
    end = "\n" if line.endswith("\n") else ""
    return f"{line[: match.start()]}{_MORE}{end}"


def ffmpeg_reason(error: Exception) -> str:
    """Return the reason of an FFmpeg error by its errno, since its text repeats the whole address."""
    return reason_of(error, "it is not an address or path that FFmpeg understands")


def located_reason_of(error: BaseException) -> str:
    """Return in one line what failed, and why; a bug, which no text explains, as its name and arguments."""
    if isinstance(error, OSError):
        where = f"{redact_to_host(str(error.filename))}: " if error.filename else ""
        return f"{where}{reason_of(error)}"
    return str(error) if isinstance(error, UserError) else repr(error)
