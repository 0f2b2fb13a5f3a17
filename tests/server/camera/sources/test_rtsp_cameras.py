"""Network cameras of all kinds over real RTSP: logins, encryption, codecs, sound, and changes at night."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from benchmarks.rtsp.cameras import passes, simulated, site_of
from benchmarks.rtsp.simulated_cameras import FPS, GOP, HEIGHT, ODD_NAME, ODD_PASSWORD, WIDTH, SimulatedCamera
from fakes.programs import needs_openssl
from fakes.rtsp.gateway import needs_gstreamer
from fakes.timeouts import PATIENCE
from server.camera.audio import LiveAudioSource
from server.camera.sources.live_stream import LiveStream
from server.config.site_config import Config
from server.system.errors import UserError

pytestmark = [needs_gstreamer, needs_openssl]

PICTURE = (
    f"videotestsrc is-live=true ! capsfilter name=size "
    f"caps=video/x-raw,format=I420,width={WIDTH},height={HEIGHT},framerate=15/1"
)
JPEG = f"{PICTURE} ! jpegenc ! rtpjpegpay name=pay0 pt=26"
SOUND = f"{JPEG} audiotestsrc is-live=true ! audio/x-raw,rate=8000,channels=1"
ODD = {"name": ODD_NAME, "password": ODD_PASSWORD}


@contextmanager
def running(camera: SimulatedCamera, folder: Path) -> Iterator[Config]:
    with simulated(camera, folder) as port:
        yield site_of(camera, port, folder)


@contextmanager
def opened(config: Config, listener: LiveAudioSource | None = None) -> Iterator[LiveStream]:
    camera = config.camera("c0")
    source = LiveStream(camera.source, camera.options, listener)
    yield source
    source.close()


def until(condition: Callable[[int], bool]) -> None:
    """Wait for a condition on the pulse, in real time."""
    for pulse in range(int(PATIENCE * FPS)):
        if condition(pulse):
            return
        time.sleep(1 / FPS)
    raise AssertionError("it never happens")


@pytest.mark.parametrize("is_encrypted", [False, True])
@pytest.mark.parametrize("method", ["basic", "digest"])
def test_a_login_may_have_any_characters(tmp_path: Path, method: str, *, is_encrypted: bool) -> None:
    camera = SimulatedCamera("", "", JPEG, login={"method": method, **ODD}, is_encrypted=is_encrypted)
    with running(camera, tmp_path) as config, opened(config) as source:
        until(lambda pulse: source.take(pulse) is not None)
        assert source.size == (WIDTH, HEIGHT)


def test_a_wrong_password_is_named_without_telling_it(tmp_path: Path) -> None:
    camera = SimulatedCamera("", "", JPEG, login={"method": "digest", **ODD})
    with running(camera, tmp_path) as config:
        wrong = config.camera("c0").source.replace("rd", "xx")
        with pytest.raises(UserError, match="401 Unauthorized") as refused:
            LiveStream(wrong, {})
    assert "rtsp://127.0.0.1" in str(refused.value)
    assert "xx" not in str(refused.value)


def test_a_certificate_is_checked_if_the_camera_has_options_for_that(tmp_path: Path) -> None:
    checked = {"rtsp_transport": "tcp", "tls_verify": "1"}
    trusted = {**checked, "ca_file": str(tmp_path / "camera.pem"), "verifyhost": "camera"}
    with running(SimulatedCamera("", "", JPEG, is_encrypted=True), tmp_path) as config:
        address = config.camera("c0").source
        with pytest.raises(UserError, match="cannot open this video"):
            LiveStream(address, checked)
        source = LiveStream(address, trusted)
        until(lambda pulse: source.take(pulse) is not None)
        source.close()


def test_h265_passes_at_a_site_of_h265_alone(tmp_path: Path) -> None:
    options = f"tune=zerolatency key-int-max={GOP} option-string=open-gop=0:scenecut=0"
    encoder = f"x265enc speed-preset=ultrafast {options} ! h265parse config-interval=-1"
    camera = SimulatedCamera("", "", f"{PICTURE} ! {encoder} ! rtph265pay name=pay0 pt=96")
    with running(camera, tmp_path) as config:
        with opened(config) as source:
            until(lambda pulse: source.take(pulse) is not None)
        assert passes(config) == "encoded: it is H.265, not H.264 (encode.codec)"
        encode = config.encode.model_copy(update={"codec": "h265"})
        assert passes(config.model_copy(update={"encode": encode})) == "passes"


def test_a_picture_that_changes_its_size_opens_the_camera_again(tmp_path: Path) -> None:
    night = "video/x-raw,format=I420,width=1280,height=720,framerate=15/1"
    camera = SimulatedCamera("", "", JPEG, later=(1.0, night))
    with running(camera, tmp_path) as config:
        with (
            opened(config) as source,
            pytest.raises(UserError, match="images are 1280x720 now, they were 640x360"),
        ):
            until(lambda pulse: source.take(pulse) is False)
        with opened(config) as source:
            until(lambda pulse: source.take(pulse) is not None)
            assert source.size == (1280, 720)


@pytest.mark.parametrize(
    "encoder",
    [
        "mulawenc ! rtppcmupay name=pay1 pt=0",
        "alawenc ! rtppcmapay name=pay1 pt=8",
        "audioresample ! audio/x-raw,rate=48000 ! opusenc ! rtpopuspay name=pay1 pt=97",
        "voaacenc ! rtpmp4gpay name=pay1 pt=97",
    ],
)
def test_sound_of_any_codec_reaches_the_site(tmp_path: Path, encoder: str) -> None:
    camera = SimulatedCamera("", "", f"{SOUND} ! {encoder}", has_sound=True)
    with running(camera, tmp_path) as config:
        listener, frames = LiveAudioSource(config.sound, FPS), 0
        assert config.sound.format is not None
        second = config.sound.format.rate / config.sound.format.samples

        def take(pulse: int) -> bool:
            nonlocal frames
            source.take(pulse)
            frames += len(listener.take(pulse))
            return frames > 2 * second

        with opened(config, listener) as source:
            until(take)
