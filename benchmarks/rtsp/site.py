"""A site of drawn cameras with the RTSP gateway and tokens."""

from __future__ import annotations

import asyncio
import contextlib
import sys
import tempfile
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path

import yaml

from benchmarks.common.environment import ROOT, CannotRunError, one_thread_environment
from client import ClientError, HttpSettings, objects
from server.cli.generated_config import free_port
from server.config.tokens_file import secret_digest

TOKEN = "a token of a benchmark"  # noqa: S105
_FPS = 8
"""Few, so that a busy machine keeps up."""
_READY_S = 300.0


@dataclass(frozen=True, slots=True)
class GatewaySite:
    """A running site."""

    process: asyncio.subprocess.Process
    http_port: int
    rtsp_port: int

    def rtsp(self, path: str, token: str | None = TOKEN) -> str:
        """Return the address of a stream."""
        login = "" if token is None else f"any:{token.replace(' ', '%20')}@"
        return f"rtsp://{login}127.0.0.1:{self.rtsp_port}{path}"

    def child(self, command: str) -> int:
        """Return the process of a command of the site, such as ``camera``'s last word.

        Raises:
            CannotRunError: it is not there.
        """
        for folder in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                words = (folder / "cmdline").read_bytes().decode().split("\0")[:-1]
                parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
                if parent == self.process.pid and command in {words[-1], *words[3:4]}:
                    return int(folder.name)
        raise CannotRunError(f"the site has no process {command}")


@contextlib.asynccontextmanager
async def running_gateway_site() -> AsyncIterator[GatewaySite]:
    """Run the site until its first person has a best view.

    Raises:
        CannotRunError: it does not get that far.
    """
    with tempfile.TemporaryDirectory() as name:
        folder, bus = Path(name), f"tcp/127.0.0.1:{free_port()}"
        content = {
            "site": {"name": "rtsp", "fps": _FPS, "width": 320, "height": 180, "niceness": 0},
            "cameras": [
                {"id": f"c{number}", "source": f"scene:room?camera={number}&cameras=2&objects=2&seed=1"}
                for number in range(2)
            ],
            "detect": {"work_width": 192, "box_filter": {"height_step": 1.16}},
            "sync": {"port": free_port(), "start_timeout_s": 60},
            "zenoh": {"connect": bus, "listen": bus},
            "http": {"port": free_port()},
            "rtsp": {"enabled": True, "port": free_port()},
            "access": {"tokens": "tokens.yaml"},
        }
        tokens = {"tokens": [{"name": "all", "sha256": secret_digest(TOKEN), "role": "watch"}]}
        (folder / "tokens.yaml").write_text(yaml.safe_dump(tokens), encoding="utf-8")
        (folder / "site.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "server.cli.main", "up", str(folder / "site.yaml")),
            cwd=ROOT,
            env=one_thread_environment(),
        )
        site = GatewaySite(process, content["http"]["port"], content["rtsp"]["port"])  # type: ignore[index]
        try:
            await asyncio.wait_for(_until_ready(site), _READY_S)
            yield site
        except TimeoutError as error:
            raise CannotRunError(f"no person was seen in {_READY_S:.0f} s") from error
        finally:
            if process.returncode is None:
                process.terminate()
            await process.wait()


async def _until_ready(site: GatewaySite) -> None:
    while True:
        if site.process.returncode is not None:
            raise CannotRunError("the site has ended: see its error above")
        with contextlib.suppress(ClientError):
            known = await objects(f"http://127.0.0.1:{site.http_port}", HttpSettings(token=TOKEN))
            if any(person.object == 1 and person.visible for person in known):
                return
        await asyncio.sleep(0.5)
