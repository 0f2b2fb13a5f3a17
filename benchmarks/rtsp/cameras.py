"""What cameras really send: each simulated camera is read as a site would, over real RTSP.

    python -m benchmarks.rtsp.cameras --out out/bench

The cameras are GStreamer's RTSP server with its encoders. Each is opened by `server.camera.sources` and read
at the site's pulses for some seconds; then whether its H.264 passes through (`encode.parameters: own`).
"""

from __future__ import annotations

import argparse
import contextlib
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import quote

from benchmarks.common.environment import ROOT, CannotRunError, finish, parser
from benchmarks.common.report import Report
from benchmarks.rtsp.simulated_cameras import CAMERAS, FPS, GOP, HEIGHT, WIDTH, SimulatedCamera
from server.camera.audio import LiveAudioSource
from server.camera.passthrough.opening import open_passthrough
from server.camera.sources.live_stream import LiveStream
from server.config.camera_password import fill_in_password
from server.config.loader import build_config
from server.config.site_config import Config
from server.system.errors import UserError

_SECONDS = 12.0
_PYTHON = "/usr/bin/python3"


@contextlib.contextmanager
def simulated(camera: SimulatedCamera, folder: Path) -> Iterator[int]:
    """Run a camera; yield its port."""
    certificate, key = (folder / "camera.pem", folder / "camera.key") if camera.is_encrypted else (None, None)
    if certificate is not None and not certificate.exists():
        options = ["-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=camera"]
        subprocess.run(
            ["openssl", "req", "-x509", *options, "-out", str(certificate), "-keyout", str(key)],
            check=True,
            capture_output=True,
        )
    given = {
        "host": "127.0.0.1",
        "certificate": None if certificate is None else str(certificate),
        "key": None if key is None else str(key),
        "login": camera.login,
        "streams": {"/live": camera.stream()},
    }
    script = ROOT / "benchmarks" / "rtsp" / "camera_server.py"
    with subprocess.Popen(
        [_PYTHON, str(script)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as server:
        if server.stdin is None or server.stdout is None:
            raise CannotRunError("the camera server has no pipes")
        server.stdin.write(json.dumps(given) + "\n")
        server.stdin.flush()
        try:
            port = server.stdout.readline()
            if not port:
                raise CannotRunError("the camera server needs GStreamer's RTSP server and encoders")
            yield int(port)
        finally:
            server.kill()


def site_of(camera: SimulatedCamera, port: int, folder: Path) -> Config:
    """Return a site with the camera, its password in a file."""
    login, settings = "", {}
    if camera.login is not None:
        login = f"{quote(camera.login['name'], safe='')}:{{password}}@"
        (folder / "password").write_text(camera.login["password"] + "\n", encoding="utf-8")
        settings["password"] = str(folder / "password")
    scheme = "rtsps" if camera.is_encrypted else "rtsp"
    content = {
        "site": {"fps": FPS, "width": WIDTH, "height": HEIGHT},
        "encode": {"gop_s": GOP / FPS, "parameters": "own"},
        "cameras": [
            {
                "id": "c0",
                "source": f"{scheme}://{login}127.0.0.1:{port}/live",
                "passthrough": "auto",
                "options": dict(camera.options),
                **settings,
            }
        ],
        **({"sound": {"source": "c0"}} if camera.has_sound else {}),
    }
    return fill_in_password(build_config(content, where="camera", folder=folder), "c0")


def read(config: Config) -> tuple[str, str, str]:
    """Read a camera at the pulses; return its sizes, the share of pulses with a picture, and its sound."""
    settings = config.camera("c0")
    listener = None if config.sound.source is None else LiveAudioSource(config.sound, FPS)
    source = LiveStream(settings.source, settings.options, listener)
    sizes, pictures, frames, pulses = [source.size], 0, 0, int(_SECONDS * FPS)
    began, problem = time.monotonic(), ""
    try:
        for pulse in range(pulses):
            time.sleep(max(0.0, began + pulse / FPS - time.monotonic()))
            try:
                pictures += source.take(pulse) is not None
            except UserError as error:
                problem = str(error).partition(": ")[2]
                source.close()
                source = LiveStream(settings.source, settings.options, listener)
                sizes.append(source.size)
            frames += 0 if listener is None else len(listener.take(pulse))
    finally:
        source.close()
    sound = ""
    if listener is not None and config.sound.format is not None:
        sound = f"{frames * config.sound.format.samples / config.sound.format.rate:.1f} s"
    size = ", then ".join(f"{width}x{height}" for width, height in sizes)
    return (
        size + (f" ({problem})" if problem and len(sizes) == 1 else ""),
        f"{100 * pictures / pulses:.0f} %",
        sound,
    )


def passes(config: Config) -> str:
    """Return whether a camera's video passes through, or why it is encoded anew."""
    opening = open_passthrough(config, config.camera("c0"), None)
    if opening.source is None:
        return f"encoded: {opening.reason}"
    opening.source.close()
    return "passes"


def try_camera(camera: SimulatedCamera, folder: Path) -> Sequence[str]:
    """Return a camera's row of the table."""
    with simulated(camera, folder) as port:
        config = site_of(camera, port, folder)
        try:
            size, pictures, sound = read(config)
            return camera.name, camera.settings, size, pictures, sound, passes(config)
        except UserError as error:
            return camera.name, camera.settings, "", "", "", f"fails: {error}"


def measure(options: argparse.Namespace) -> None:
    """Try all cameras whose name contains a word, and print the table."""
    report, rows = Report(), []
    with tempfile.TemporaryDirectory() as folder:
        for camera in CAMERAS:
            if options.only in camera.name:
                rows.append(try_camera(camera, Path(folder)))
                print(" | ".join(rows[-1]), file=sys.stderr)
    columns = ("camera", "settings", "picture", "pulses with one", f"sound in {_SECONDS:.0f} s", "H.264")
    report.table("What cameras send", columns, rows)
    report.save(options.out / "rtsp_cameras.txt")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__ or "", "rtsp.cameras")
    options.add_argument("--only", default="", help="cameras whose name contains this")
    measure(options.parse_args())


if __name__ == "__main__":
    try:
        main()
    except CannotRunError as problem:
        finish(problem, "rtsp.cameras")
