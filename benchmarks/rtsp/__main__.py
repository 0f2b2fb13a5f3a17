"""The clients of the RTSP gateway, tried one by one; and what one sees when a process of the site dies.

    python -m benchmarks.rtsp --out out/bench

Runs a real site (`myview up`) of drawn cameras with tokens. FFmpeg, GStreamer, mpv and VLC ask for a view
of a person and a camera, over TCP and UDP, with and without a token.
"""

from __future__ import annotations

import argparse
import asyncio
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.common.environment import CannotRunError, finish, parser
from benchmarks.common.report import Report
from benchmarks.rtsp.failures import watch_failures
from benchmarks.rtsp.site import TOKEN, GatewaySite, running_gateway_site

_FRAMES = 30
_TIMEOUT_S = 60.0
_PATHS = ("/objects/1", "/cameras/c1")
_LIVE555 = "/usr/lib/*/vlc/plugins/access/liblive555_plugin.so"


@dataclass(frozen=True, slots=True)
class Client:
    """A program, and how it is told the transport."""

    name: str
    program: str
    version: tuple[str, ...] = ("--version",)

    def command(self, url: str, transport: str) -> Sequence[str]:
        """Return the command that plays some frames and ends."""
        match self.program:
            case "ffmpeg":
                options = ["-v", "error", "-rtsp_transport", transport, "-i", url]
                return ["ffmpeg", *options, "-frames:v", str(_FRAMES), "-f", "null", "-"]
            case "gst-launch-1.0":
                source = ["rtspsrc", f"location={url}", f"protocols={transport}"]
                sink = ["rtph264depay", "!", "h264parse", "!", "fakesink", f"num-buffers={_FRAMES}"]
                return ["gst-launch-1.0", "-q", *source, "!", *sink]
            case "mpv":
                options = ["--no-config", "--vo=null", "--ao=null", "--really-quiet", f"--frames={_FRAMES}"]
                return ["mpv", *options, f"--rtsp-transport={transport}", url]
            case _:
                tcp = ["--rtsp-tcp"] if transport == "tcp" else []
                return [
                    "cvlc",
                    "-I",
                    "dummy",
                    "--vout=dummy",
                    "--aout=dummy",
                    *tcp,
                    "--run-time=3",
                    url,
                    "vlc://quit",
                ]

    def about(self) -> str:
        """Return the program's name and version, or that it is not there."""
        if shutil.which(self.program) is None:
            return f"{self.name}: not installed"
        if self.program == "cvlc" and not list(Path("/").glob(_LIVE555[1:])):
            return f"{self.name}: built without RTSP (no live555)"
        asked = subprocess.run([self.program, *self.version], capture_output=True, text=True, check=False)
        return " ".join((asked.stdout or asked.stderr).splitlines()[0].split()[:3])


CLIENTS = (
    Client("FFmpeg", "ffmpeg", ("-version",)),
    Client("GStreamer", "gst-launch-1.0"),
    Client("mpv", "mpv"),
    Client("VLC", "cvlc"),
)


async def try_client(client: Client, site: GatewaySite, path: str, transport: str, token: str | None) -> str:
    """Return what a client gets: a number of frames, or its error."""
    process = await asyncio.create_subprocess_exec(
        *client.command(site.rtsp(path, token), transport),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    began = time.monotonic()
    try:
        output, _ = await asyncio.wait_for(process.communicate(), _TIMEOUT_S)
    except TimeoutError:
        process.kill()
        await process.wait()
        return f"nothing in {_TIMEOUT_S:.0f} s"
    text = output.decode(errors="replace")
    if "401" in text or "Unauthorized" in text:
        return "401"
    if process.returncode == 0:
        return f"{_FRAMES} frames in {time.monotonic() - began:.1f} s"
    print(text, file=sys.stderr)
    return "refused" if token != TOKEN else f"exit code {process.returncode}"


async def clients_table(report: Report, site: GatewaySite) -> None:
    """Try all clients."""
    rows: list[Sequence[str]] = []
    for client in CLIENTS:
        about = client.about()
        if ":" in about:
            rows.append((about, "", "", "", "", ""))
            continue
        for transport in ("tcp", "udp"):
            played = [await try_client(client, site, path, transport, TOKEN) for path in _PATHS]
            refused = [
                await try_client(client, site, _PATHS[0], transport, token) for token in (None, "wrong")
            ]
            rows.append((about, transport.upper(), *played, *refused))
    columns = ("client", "transport", *_PATHS, "without token", "wrong token")
    report.table("Clients of the RTSP gateway", columns, rows)


async def measure(options: argparse.Namespace) -> None:
    """Run the site and print both tables."""
    report = Report()
    async with running_gateway_site() as site:
        await clients_table(report, site)
        rows = await watch_failures(site)
        columns = ("what died (SIGKILL)", "longest pause, s", "frames after it", "the client")
        report.table("A client over TCP while a process dies", columns, rows)
    report.save(options.out / "rtsp_clients.txt")


def main() -> None:
    """Run the benchmark."""
    options = parser(__doc__ or "", "rtsp").parse_args()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if shutil.which("gst-launch-1.0") is None and shutil.which("ffmpeg") is None:
        raise CannotRunError("no client is installed")
    asyncio.run(measure(options))


if __name__ == "__main__":
    try:
        main()
    except CannotRunError as problem:
        finish(problem, "rtsp")
