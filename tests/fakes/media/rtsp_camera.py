"""A minimal RTSP server (RFC 2326): H.264 (RFC 6184) or H.265 (RFC 7798) over RTP, interleaved over TCP."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import re
import socketserver
import struct
import threading
import time
from collections.abc import Iterator, Sequence

from server.camera.encoder import AccessUnit
from server.media.codec import nal_codec
from server.media.nal_units import nal_units
from server.media.picture import Codec

_PAYLOAD_TYPE = 96
_MAX_BYTES = 200
"""Bytes of a NAL unit in one packet: few, so that small pictures are fragmented."""
_FU_A, _FU_H265 = 28, 49
_NTP_EPOCH = 2_208_988_800
"""Seconds from 1900 to 1970."""


_REALM, _NONCE = "a camera", "0123456789abcdef"


class RtspCamera:
    """Serves access units at a frame rate over TCP, up to the GOP number `gop_limit`.

    ``login`` is a user and a password, asked for by Digest (RFC 2617). ``live``: sends in real time and
    endlessly, to each client what a common clock says, `delay_s` later; with ``reports``, RTCP sender reports
    tell that clock.
    """

    def __init__(
        self,
        gops: Sequence[Sequence[AccessUnit]],
        fps: float,
        *,
        login: tuple[str, str] | None = None,
        live: bool = False,
        began: float | None = None,
        delay_s: float = 0.0,
        reports: bool = False,
        port: int = 0,
        codec: Codec = "h264",
    ) -> None:
        self.codec = codec
        self.gops, self.fps, self.gop_limit = gops, fps, 40
        self.login, self.live = login, live
        self.began = time.monotonic() if began is None else began
        self.delay_s, self.reports = delay_s, reports
        self.stop = threading.Event()
        self._server = _Server(self, port)
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,))
        self._thread.start()
        self.url = f"rtsp://127.0.0.1:{self._server.server_address[1]}/live"

    @property
    def unix_began(self) -> float:
        """The unix time of the first access unit."""
        return self.began + time.time() - time.monotonic()

    def close(self) -> None:
        """Stop the server."""
        self.stop.set()
        if self._thread.is_alive():
            self._server.shutdown()
            self._thread.join()
            self._server.server_close()


class _Server(socketserver.ThreadingTCPServer):
    daemon_threads = allow_reuse_address = True

    def __init__(self, camera: RtspCamera, port: int) -> None:
        super().__init__(("127.0.0.1", port), _Handler)
        self.camera = camera


class _Handler(socketserver.StreamRequestHandler):
    server: _Server

    def handle(self) -> None:
        while request := self.rfile.readline().decode():
            method, address, _ = request.split()
            self._answer(method, address, dict(iter(self._header, None)))
            if method == "PLAY":
                with contextlib.suppress(OSError):
                    self._play(self.server.camera)
                return

    def _header(self) -> tuple[str, str] | None:
        name, colon, value = self.rfile.readline().decode().partition(":")
        return (name.lower(), value.strip()) if colon else None

    def _answer(self, method: str, address: str, headers: dict[str, str]) -> None:
        status, headers_out, body = "200 OK", [f"CSeq: {headers['cseq']}"], b""
        if not _is_permitted(method, headers.get("authorization", ""), self.server.camera.login):
            status = "401 Unauthorized"
            headers_out.append(f'WWW-Authenticate: Digest realm="{_REALM}", nonce="{_NONCE}"')
        elif method == "OPTIONS":
            headers_out.append("Public: OPTIONS, DESCRIBE, SETUP, PLAY, TEARDOWN")
        elif method == "DESCRIBE":
            body = _describe(self.server.camera.gops[0][0], self.server.camera.codec)
            headers_out += [f"Content-Base: {address}/", "Content-Type: application/sdp"]
            headers_out.append(f"Content-Length: {len(body)}")
        elif "TCP" in headers.get("transport", "TCP"):
            headers_out += ["Session: 1", "Transport: RTP/AVP/TCP;unicast;interleaved=0-1"]
        else:
            status = "461 Unsupported Transport"
        self.wfile.write("\r\n".join([f"RTSP/1.0 {status}", *headers_out, "", ""]).encode() + body)

    def _play(self, camera: RtspCamera) -> None:
        number = 0
        for time_s, unit in _live_units(camera) if camera.live else _units(camera):
            stamp = round(time_s * 90_000) % 2**32
            if camera.reports:
                report = _sender_report(camera.unix_began + time_s, stamp)
                self.wfile.write(struct.pack(">cBH", b"$", 1, len(report)) + report)
            for payload, is_last in _payloads(unit, camera.codec):
                kind = _PAYLOAD_TYPE | is_last << 7
                packet = struct.pack(">BBHII", 0x80, kind, number % 2**16, stamp, 1) + payload
                self.wfile.write(struct.pack(">cBH", b"$", 0, len(packet)) + packet)
                number += 1


def _sender_report(unix: float, stamp: int) -> bytes:
    """Return a sender report (RFC 3550, 6.4.1) that a moment has a time stamp."""
    seconds = int(unix)
    fraction = int((unix - seconds) * 2**32)
    return struct.pack(">BBHIIIIII", 0x80, 200, 6, 1, seconds + _NTP_EPOCH, fraction, stamp, 0, 0)


def _units(camera: RtspCamera) -> Iterator[tuple[float, AccessUnit]]:
    """Yield all access units, with their times in seconds, up to the limit."""
    for place, gop in enumerate(camera.gops):
        while place >= camera.gop_limit:
            if camera.stop.wait(0.002):
                return
        yield from ((unit.pulse / camera.fps, unit) for unit in gop)


def _live_units(camera: RtspCamera) -> Iterator[tuple[float, AccessUnit]]:
    """Yield access units when they are due, from the next GOP on, again and again."""
    frames = sum(map(len, camera.gops))
    starts = [sum(map(len, camera.gops[:place])) for place in range(len(camera.gops))]
    now = (time.monotonic() - camera.began) * camera.fps
    rounds, place = int(now // frames), next((p for p, s in enumerate(starts) if s >= now % frames), 0)
    rounds += place == 0 and now % frames > 0
    while True:
        for unit_place, unit in enumerate(camera.gops[place], starts[place]):
            due = (rounds * frames + unit_place) / camera.fps
            if camera.stop.wait(max(0.0, camera.began + due + camera.delay_s - time.monotonic())):
                return
            yield due, unit
        place = (place + 1) % len(camera.gops)
        rounds += place == 0


def _is_permitted(method: str, header: str, login: tuple[str, str] | None) -> bool:
    """Check a Digest response (RFC 2617, 3.2.2) without quality of protection."""
    if login is None or method == "OPTIONS":
        return True
    fields = dict(re.findall(r'(\w+)="([^"]*)"', header))
    own = _md5(f"{login[0]}:{_REALM}:{login[1]}")
    request = _md5(f"{method}:{fields.get('uri', '')}")
    wanted = _md5(f"{own}:{_NONCE}:{request}")
    return fields.get("response") == wanted and fields.get("username") == login[0]


def _md5(text: str) -> str:
    return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()


def _describe(key: AccessUnit, codec: Codec) -> bytes:
    units = nal_codec(codec).select_sets(nal_units(key.data))
    sets = [base64.b64encode(parameter_set).decode() for parameter_set in units]
    if codec == "h265":
        fields = "; ".join(
            f"sprop-{kind}={one}" for kind, one in zip(("vps", "sps", "pps"), sets, strict=True)
        )
    else:
        fields = f"packetization-mode=1;sprop-parameter-sets={','.join(sets)}"
    lines = [
        "v=0",
        "o=- 0 0 IN IP4 127.0.0.1",
        "s=a camera",
        "t=0 0",
        f"m=video 0 RTP/AVP {_PAYLOAD_TYPE}",
        f"a=rtpmap:{_PAYLOAD_TYPE} {codec.upper()}/90000",
        f"a=fmtp:{_PAYLOAD_TYPE} {fields}",
        "a=control:video",
    ]
    return "\r\n".join([*lines, ""]).encode()


def _payloads(unit: AccessUnit, codec: Codec) -> Iterator[tuple[bytes, bool]]:
    """Yield RTP payloads, and whether each is the last of the picture."""
    units = list(nal_units(unit.data))
    for index, nal in enumerate(units):
        is_last_unit = index == len(units) - 1
        if len(nal) <= _MAX_BYTES:
            yield nal, is_last_unit
            continue
        offsets = range(2 if codec == "h265" else 1, len(nal), _MAX_BYTES)
        for at in offsets:
            is_first, is_last = at == offsets[0], at == offsets[-1]
            if codec == "h265":
                head = bytes(
                    [nal[0] & 0x81 | _FU_H265 << 1, nal[1], is_first << 7 | is_last << 6 | nal[0] >> 1]
                )
            else:
                head = bytes([nal[0] & 0xE0 | _FU_A, is_first << 7 | is_last << 6 | nal[0] & 0x1F])
            yield head + nal[at : at + _MAX_BYTES], is_last_unit and is_last
