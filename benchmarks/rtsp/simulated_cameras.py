"""What cameras send, as simulated ones: encoder settings, sound, logins and changes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

_RATE = "15/1"
FPS = 15.0
WIDTH, HEIGHT = 640, 360
GOP = 6
"""Frames of the site's GOPs."""
ODD_PASSWORD = "p@ss:w/rd?#%&=+ é'\"{x}"  # noqa: S105
ODD_NAME = "ad min@home"


def _picture(size: tuple[int, int] = (WIDTH, HEIGHT), rate: str = _RATE) -> str:
    return f"videotestsrc is-live=true pattern=ball ! capsfilter name=size caps={_caps(size, rate)}"


def _caps(size: tuple[int, int], rate: str = _RATE) -> str:
    return f"video/x-raw,format=I420,width={size[0]},height={size[1]},framerate={rate}"


def _h264(options: str, profile: str = "high", picture: str = "") -> str:
    encoder = (
        f"x264enc speed-preset=ultrafast {options} ! video/x-h264,stream-format=byte-stream,profile={profile}"
    )
    return f"{picture or _picture()} ! {encoder} ! rtph264pay name=pay0 pt=96"


def _h265(options: str) -> str:
    encoder = f"x265enc speed-preset=ultrafast {options} ! h265parse config-interval=-1"
    return f"{_picture()} ! {encoder} ! rtph265pay name=pay0 pt=96"


_ONE_SLICE = "tune=zerolatency sliced-threads=false threads=1"
_PLAIN = _h264(f"{_ONE_SLICE} key-int-max={GOP}", "baseline")


def _sound(rate: int, channels: int, encoder: str) -> str:
    return f"{_PLAIN} audiotestsrc is-live=true ! audio/x-raw,rate={rate},channels={channels} ! {encoder}"


@dataclass(frozen=True, slots=True)
class SimulatedCamera:
    """A camera.

    Attributes:
        name: what it stands for.
        settings: its encoder's settings, in words.
        pipeline: GStreamer's.
        later: after so many seconds, what its picture becomes (caps).
        login: how it wants to be asked.
        is_encrypted: RTSP over TLS, with a certificate of its own.
        has_sound: whether sound is expected.
        options: FFmpeg's, as in a camera's `options`.
    """

    name: str
    settings: str
    pipeline: str = _PLAIN
    later: tuple[float, str] | None = None
    login: Mapping[str, str] | None = None
    is_encrypted: bool = False
    has_sound: bool = False
    options: Mapping[str, str] = field(default_factory=lambda: {"rtsp_transport": "tcp"})

    def stream(self) -> dict[str, Any]:
        """Return what the camera server is told."""
        return {"pipeline": self.pipeline, **({} if self.later is None else {"later": self.later})}


def _odd(method: str) -> dict[str, str]:
    return {"method": method, "name": ODD_NAME, "password": ODD_PASSWORD}


_FAST = "tune=zerolatency"
CAMERAS = (
    SimulatedCamera("H.264 that fits", f"baseline, fixed GOP {GOP}, no B frames"),
    SimulatedCamera("H.264, UDP", f"baseline, fixed GOP {GOP}", options={"rtsp_transport": "udp"}),
    SimulatedCamera("H.264, long GOP", "main, GOP 60", _h264(f"{_FAST} key-int-max=60", "main")),
    SimulatedCamera(
        "H.264, B frames",
        "high, GOP 30, 2 B frames",
        _h264("bframes=2 b-adapt=false key-int-max=30 rc-lookahead=0"),
    ),
    SimulatedCamera(
        "H.264, smart codec", "high, GOP up to 250, scene cuts", _h264(f"{_FAST} key-int-max=250")
    ),
    SimulatedCamera(
        "H.264, intra refresh",
        "high, no keyframes but the first",
        _h264(f"{_FAST} intra-refresh=true key-int-max=30"),
    ),
    SimulatedCamera(
        "H.264, 4 slices",
        f"baseline, GOP {GOP}",
        _h264(f"{_FAST} sliced-threads=true threads=4 key-int-max={GOP}", "baseline"),
    ),
    SimulatedCamera(
        "H.264, main stream",
        "1920x1080, GOP 30",
        _h264(f"{_FAST} key-int-max=30", picture=_picture((1920, 1080))),
    ),
    SimulatedCamera(
        "H.264, square sub-stream",
        "352x288, GOP 30",
        _h264(f"{_FAST} key-int-max=30", picture=_picture((352, 288))),
    ),
    SimulatedCamera("H.265", "main, GOP 30, no B frames", _h265(f"{_FAST} key-int-max=30")),
    SimulatedCamera("H.265, B frames", "main, GOP 30", _h265("key-int-max=30 option-string=bframes=2")),
    SimulatedCamera("MJPEG", "quality 85", f"{_picture()} ! jpegenc ! rtpjpegpay name=pay0 pt=26"),
    SimulatedCamera("size changes at night", "640x360, after 6 s 1280x720", later=(6.0, _caps((1280, 720)))),
    SimulatedCamera(
        "rate changes at night", "15, after 6 s 5 frames/s", later=(6.0, _caps((WIDTH, HEIGHT), "5/1"))
    ),
    SimulatedCamera(
        "sound: G.711 µ-law",
        "8 kHz mono",
        _sound(8000, 1, "mulawenc ! rtppcmupay name=pay1 pt=0"),
        has_sound=True,
    ),
    SimulatedCamera(
        "sound: G.711 A-law",
        "8 kHz mono",
        _sound(8000, 1, "alawenc ! rtppcmapay name=pay1 pt=8"),
        has_sound=True,
    ),
    SimulatedCamera(
        "sound: AAC",
        "16 kHz mono, RFC 3640",
        _sound(16000, 1, "avenc_aac ! rtpmp4gpay name=pay1 pt=97"),
        has_sound=True,
    ),
    SimulatedCamera(
        "sound: AAC",
        "48 kHz stereo, LATM",
        _sound(48000, 2, "avenc_aac ! rtpmp4apay name=pay1 pt=97"),
        has_sound=True,
    ),
    SimulatedCamera(
        "sound: Opus",
        "48 kHz stereo",
        _sound(48000, 2, "opusenc ! rtpopuspay name=pay1 pt=97"),
        has_sound=True,
    ),
    SimulatedCamera(
        "sound: L16",
        "44.1 kHz stereo",
        _sound(44100, 2, "audioconvert ! rtpL16pay name=pay1 pt=97"),
        has_sound=True,
    ),
    SimulatedCamera("login: Basic", "odd characters", login=_odd("basic")),
    SimulatedCamera("login: Digest", "odd characters", login=_odd("digest")),
    SimulatedCamera("RTSP over TLS", "its own certificate", is_encrypted=True),
    SimulatedCamera(
        "RTSP over TLS, login", "Digest, odd characters", login=_odd("digest"), is_encrypted=True
    ),
)
