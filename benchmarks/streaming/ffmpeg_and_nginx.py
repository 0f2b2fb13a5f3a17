"""Alternatives to compare with: ffmpeg that switches inputs and re-encodes, nginx that serves segments."""

from __future__ import annotations

import contextlib
import http.client
import os
import resource
import shutil
import subprocess
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.common.started_processes import terminate
from benchmarks.streaming.simulated_cameras import ENCODE, GOP, SITE
from benchmarks.streaming.stream_site import StreamSite
from server.camera.encoder import AccessUnit
from server.cli.generated_config import free_port

_CUT_S = 2.0
_START_S = 10.0
_TICK_S = 1.0 / os.sysconf("SC_CLK_TCK")
_NGINX = """
daemon off; worker_processes 1; pid {folder}/nginx.pid; error_log {folder}/error.log;
{user}
events {{ worker_connections 8192; }}
http {{
  access_log off; sendfile on; tcp_nopush on; keepalive_requests 1000000;
  types {{ application/vnd.apple.mpegurl m3u8; video/mp4 mp4 m4s; }}
  client_body_temp_path {folder}/body; proxy_temp_path {folder}/proxy; fastcgi_temp_path {folder}/fast;
  uwsgi_temp_path {folder}/uwsgi; scgi_temp_path {folder}/scgi;
  server {{ listen 127.0.0.1:{port}; root {folder}; }}
}}
"""


def ffmpeg_switching(films: Sequence[Sequence[AccessUnit]], frames: int, folder: Path) -> float | None:
    """Return the processor microseconds per frame of ffmpeg that cuts between all cameras every two seconds.

    It decodes every camera and re-encodes the result. None if ffmpeg is missing.
    """
    program = shutil.which("ffmpeg")
    if program is None:
        return None
    inputs = []
    for number, film in enumerate(films):
        path = folder / f"c{number}.h264"
        path.write_bytes(b"".join(film[pulse % len(film)].data for pulse in range(frames)))
        inputs += ["-threads", "1", "-framerate", f"{SITE.fps:g}", "-i", str(path)]
    cuts = range(1, int(frames / SITE.fps / _CUT_S) + 1)
    commands = "; ".join(f"{cut * _CUT_S:g} streamselect map {cut % len(films)}" for cut in cuts)
    labels = "".join(f"[{number}:v]" for number in range(1, len(films)))
    graph = f"[0:v]sendcmd=c='{commands}'[first];[first]{labels}streamselect=inputs={len(films)}:map=0[out]"
    encode = ["-c:v", "libx264", "-preset", ENCODE.preset, "-tune", "zerolatency", "-crf", f"{ENCODE.crf}"]
    output = ["-g", f"{GOP}", "-threads", "1", "-f", "null", "-"]
    words = [program, "-nostdin", "-v", "error", "-filter_threads", "1", "-filter_complex_threads", "1"]
    before = _children_seconds()
    subprocess.run([*words, *inputs, "-filter_complex", graph, "-map", "[out]", *encode, *output], check=True)
    return 1e6 * (_children_seconds() - before) / frames


@dataclass(frozen=True, slots=True)
class HlsServingCost:
    """Cost of serving HLS over persistent connections."""

    requests: int
    """Number of pairs of a playlist and a segment, of which a viewer fetches one per second."""
    microseconds: float
    """Processor time of a pair."""
    kilobytes: float
    """Size of a segment."""

    @property
    def per_core(self) -> float:
        """Viewers per core at one segment a second."""
        return 1e6 / self.microseconds


def hls_from_service(site: StreamSite, number: int, seconds: float) -> HlsServingCost:
    """Fetch an object's playlist and newest segment from the best-view process repeatedly."""
    before = site.processor_seconds
    pairs, size = _fetch(site.http, f"/objects/{number}/hls/", seconds)
    return HlsServingCost(pairs, 1e6 * (site.processor_seconds - before) / pairs, size / 1e3)


def hls_from_nginx(site: StreamSite, number: int, seconds: float, folder: Path) -> HlsServingCost | None:
    """Fetch copies of the same files from nginx; None if nginx is missing."""
    program = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin")
    if program is None:
        return None
    folder.mkdir()
    connection = http.client.HTTPConnection("127.0.0.1", site.http)
    playlist = _get(connection, f"/objects/{number}/hls/index.m3u8")
    (folder / "index.m3u8").write_bytes(playlist)
    newest = _newest_segment(playlist)
    (folder / newest).write_bytes(_get(connection, f"/objects/{number}/hls/{newest}"))
    connection.close()
    port = free_port()
    with _nginx(program, folder, port) as worker:
        before = _processor_seconds(worker)
        pairs, size = _fetch(port, "/", seconds)
        return HlsServingCost(pairs, 1e6 * (_processor_seconds(worker) - before) / pairs, size / 1e3)


@contextlib.contextmanager
def _nginx(program: str, folder: Path, port: int) -> Iterator[int]:
    """Run nginx; yield the id of its worker process."""
    user = "user root;" if os.geteuid() == 0 else ""
    config = folder / "nginx.conf"
    config.write_text(_NGINX.format(folder=folder, port=port, user=user), encoding="utf-8")
    process = subprocess.Popen([program, "-c", str(config), "-p", str(folder)])
    try:
        yield _worker(process.pid)
    finally:
        terminate([process])


def _worker(parent: int) -> int:
    children = Path(f"/proc/{parent}/task/{parent}/children")
    deadline = time.monotonic() + _START_S
    while time.monotonic() < deadline:
        if found := children.read_text(encoding="ascii").split():
            return int(found[0])
        time.sleep(0.05)
    raise RuntimeError("nginx did not start")


def _fetch(port: int, folder: str, seconds: float) -> tuple[int, int]:
    """Fetch pairs over one connection; return their number and the bytes of the last segment."""
    connection = http.client.HTTPConnection("127.0.0.1", port)
    pairs, size, until = 0, 0, time.monotonic() + seconds
    while time.monotonic() < until:
        newest = _newest_segment(_get(connection, f"{folder}index.m3u8"))
        size = len(_get(connection, f"{folder}{newest}"))
        pairs += 1
    connection.close()
    return pairs, size


def _newest_segment(playlist: bytes) -> str:
    """Return the last complete segment, which tags of the current one's parts may follow."""
    return next(line for line in reversed(playlist.decode().splitlines()) if not line.startswith("#"))


def _get(connection: http.client.HTTPConnection, path: str) -> bytes:
    connection.request("GET", path)
    answer = connection.getresponse()
    data = answer.read()
    if answer.status != http.HTTPStatus.OK:
        raise RuntimeError(f"{path}: {answer.status}")
    return data


def _children_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def _processor_seconds(pid: int) -> float:
    words = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) * _TICK_S
