"""A simulated ONVIF camera: answers WS-Discovery over UDP and SOAP over HTTP, and names RTSP streams."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import http.server
import re
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from urllib.parse import quote

_SOAP = """<?xml version="1.0" encoding="utf-8"?>
<s:Envelope xmlns:s="http://www.w3.org/2003/05/soap-envelope" xmlns:tds="http://www.onvif.org/ver10/device/wsdl"
 xmlns:trt="http://www.onvif.org/ver10/media/wsdl" xmlns:tt="http://www.onvif.org/ver10/schema"
 xmlns:ter="http://www.onvif.org/ver10/error"><s:Body>{}</s:Body></s:Envelope>"""
_MATCH = """<?xml version="1.0" encoding="utf-8"?>
<s:Envelope xmlns:s="http://www.w3.org/2003/05/soap-envelope"
 xmlns:a="http://schemas.xmlsoap.org/ws/2004/08/addressing"
 xmlns:d="http://schemas.xmlsoap.org/ws/2005/04/discovery"><s:Header>
<a:MessageID>urn:uuid:answer</a:MessageID><a:RelatesTo>{related}</a:RelatesTo>
<a:Action>http://schemas.xmlsoap.org/ws/2005/04/discovery/ProbeMatches</a:Action></s:Header><s:Body>
<d:ProbeMatches><d:ProbeMatch><a:EndpointReference><a:Address>urn:uuid:{name}</a:Address></a:EndpointReference>
<d:Types>dn:NetworkVideoTransmitter</d:Types>
<d:Scopes>onvif://www.onvif.org/type/video_encoder onvif://www.onvif.org/name/{name}
 onvif://www.onvif.org/hardware/Model%20{name}</d:Scopes>
<d:XAddrs>{service}</d:XAddrs></d:ProbeMatch></d:ProbeMatches></s:Body></s:Envelope>"""
_FAULT = """<s:Fault><s:Code><s:Value>s:Sender</s:Value><s:Subcode><s:Value>ter:NotAuthorized</s:Value>
</s:Subcode></s:Code><s:Reason><s:Text xml:lang="en">Sender not Authorized</s:Text></s:Reason></s:Fault>"""
_TIME = """<tds:GetSystemDateAndTimeResponse><tds:SystemDateAndTime><tt:DateTimeType>NTP</tt:DateTimeType>
<tt:DaylightSavings>false</tt:DaylightSavings><tt:UTCDateTime><tt:Time><tt:Hour>8</tt:Hour>
<tt:Minute>5</tt:Minute><tt:Second>0</tt:Second></tt:Time><tt:Date><tt:Year>2020</tt:Year><tt:Month>1</tt:Month>
<tt:Day>2</tt:Day></tt:Date></tt:UTCDateTime></tds:SystemDateAndTime></tds:GetSystemDateAndTimeResponse>"""
_SERVICE = """<tds:Service><tds:Namespace>http://www.onvif.org/ver10/{name}/wsdl</tds:Namespace>
<tds:XAddr>{address}</tds:XAddr><tds:Version><tt:Major>2</tt:Major><tt:Minor>60</tt:Minor></tds:Version>
</tds:Service>"""
_PROFILE = """<trt:Profiles token="{name}" fixed="true"><tt:Name>{name}</tt:Name>
<tt:VideoEncoderConfiguration token="e"><tt:Name>e</tt:Name><tt:UseCount>1</tt:UseCount>
<tt:Encoding>H264</tt:Encoding><tt:Resolution><tt:Width>{width}</tt:Width><tt:Height>{height}</tt:Height>
</tt:Resolution><tt:Quality>5</tt:Quality><tt:RateControl><tt:FrameRateLimit>{fps}</tt:FrameRateLimit>
<tt:EncodingInterval>1</tt:EncodingInterval><tt:BitrateLimit>4096</tt:BitrateLimit></tt:RateControl>
</tt:VideoEncoderConfiguration></trt:Profiles>"""
_URI = """<trt:GetStreamUriResponse><trt:MediaUri><tt:Uri>{uri}</tt:Uri>
<tt:InvalidAfterConnect>false</tt:InvalidAfterConnect><tt:InvalidAfterReboot>false</tt:InvalidAfterReboot>
<tt:Timeout>PT0S</tt:Timeout></trt:MediaUri></trt:GetStreamUriResponse>"""


@dataclass(frozen=True, slots=True)
class FakeProfile:
    """A stream that the camera names."""

    name: str
    address: str
    width: int
    height: int
    fps: int


class OnvifCamera:
    """Answers probes at UDP port :attr:`discovery_port`, and SOAP at :attr:`port`, both of 127.0.0.1.

    ``login``: user and password of a WS-UsernameToken, whose digest is checked. ``answer`` replaces every
    SOAP answer, ``match`` every answer to a probe; ``damage`` changes what is sent.
    """

    def __init__(
        self,
        name: str,
        profiles: Sequence[FakeProfile],
        login: tuple[str, str] | None = None,
        *,
        answer: bytes | None = None,
        damage: Callable[[bytes], bytes] = lambda body: body,
        match: bytes | None = None,
    ) -> None:
        self.name, self.profiles, self.login = name, profiles, login
        self.answer, self.match, self.damage = answer, match, damage
        self._http = _Server(self)
        self.port = int(self._http.server_address[1])
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._udp.bind(("127.0.0.1", 0))
        self.discovery_port = int(self._udp.getsockname()[1])
        self._threads = [
            threading.Thread(target=self._http.serve_forever, args=(0.02,)),
            threading.Thread(target=self._answer_probes),
        ]
        for thread in self._threads:
            thread.start()

    @property
    def service(self) -> str:
        return f"http://127.0.0.1:{self.port}/onvif/device_service"

    def close(self) -> None:
        self._http.shutdown()
        self._udp.sendto(b"", self._udp.getsockname())
        for thread in self._threads:
            thread.join()
        self._http.server_close()
        self._udp.close()

    def _answer_probes(self) -> None:
        while True:
            datagram, sender = self._udp.recvfrom(65_536)
            if not datagram:
                return
            related = re.search(rb"MessageID>([^<]*)<", datagram)
            if self.match is not None:
                self._udp.sendto(self.match, sender)
            elif related is not None and b"NetworkVideoTransmitter" in datagram:
                text = _MATCH.format(related=related[1].decode(), name=quote(self.name), service=self.service)
                self._udp.sendto(text.encode(), sender)

    def respond(self, request: str) -> str:
        """Return the SOAP answer to a request."""
        if "GetSystemDateAndTime" in request:
            return _SOAP.format(_TIME)
        if self.login is not None and not _is_signed(request, *self.login):
            return _SOAP.format(_FAULT)
        if "GetServices" in request:
            services = "".join(_SERVICE.format(name=one, address=self.service) for one in ("device", "media"))
            return _SOAP.format(f"<tds:GetServicesResponse>{services}</tds:GetServicesResponse>")
        if "GetStreamUri" in request:
            named = re.search(r"ProfileToken>([^<]*)<", request)
            uri = next(one.address for one in self.profiles if named is not None and one.name == named[1])
            return _SOAP.format(_URI.format(uri=uri))
        profiles = "".join(
            _PROFILE.format(name=one.name, width=one.width, height=one.height, fps=one.fps)
            for one in self.profiles
        )
        return _SOAP.format(f"<trt:GetProfilesResponse>{profiles}</trt:GetProfilesResponse>")


class _Server(http.server.ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, camera: OnvifCamera) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.camera = camera


class _Handler(http.server.BaseHTTPRequestHandler):
    server: _Server

    def do_POST(self) -> None:
        request = self.rfile.read(int(self.headers["Content-Length"])).decode()
        camera = self.server.camera
        body = camera.respond(request).encode() if camera.answer is None else camera.answer
        body = camera.damage(body)
        self.send_response(400 if b"Fault>" in body else 200)
        self.send_header("Content-Type", "application/soap+xml; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        with contextlib.suppress(OSError):
            self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Log nothing."""


def _is_signed(request: str, user: str, password: str) -> bool:
    """Check the digest of a WS-UsernameToken (OASIS, 3.1)."""
    found = {
        name: re.search(rf":{name}(?: [^>]*)?>([^<]*)<", request)
        for name in ("Username", "Password", "Nonce", "Created")
    }
    values = {name: match[1] for name, match in found.items() if match is not None}
    if len(values) < len(found):
        return False
    nonce = base64.b64decode(values["Nonce"])
    digest = hashlib.sha1(
        nonce + values["Created"].encode() + password.encode(), usedforsecurity=False
    ).digest()
    return values["Username"] == user and base64.b64decode(values["Password"]) == digest


@contextlib.contextmanager
def onvif_cameras(*cameras: OnvifCamera) -> Iterator[str]:
    """Close cameras at the end; yield the value of MYVIEW_DISCOVERY by which they are found."""
    try:
        yield ",".join(f"127.0.0.1:{camera.discovery_port}" for camera in cameras)
    finally:
        for camera in cameras:
            camera.close()
