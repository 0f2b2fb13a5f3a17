"""Process priorities, checked on real processes."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from fakes.timeouts import PATIENCE
from server.cli.generated_config import free_port
from server.system.child_process import start_worker
from server.system.niceness import lower_priority

NOBODY = 2**22 + 1  # more than a process's number can be (proc(5), pid_max)
BEFORE = os.getpriority(os.PRIO_PROCESS, 0)

pytestmark = pytest.mark.skipif(BEFORE > 10, reason="there is not much that is nicer than these tests")


def niceness(pid: int) -> int:
    return os.getpriority(os.PRIO_PROCESS, pid)


def niceness_after(*steps: int) -> int:
    """Return the niceness of a process after some calls."""
    calls = "; ".join(f"lower_own_priority({by})" for by in steps)
    script = f"import os; from server.system.niceness import lower_own_priority; {calls}; print(os.nice(0))"
    return int(subprocess.run([sys.executable, "-c", script], capture_output=True, check=True).stdout)


@pytest.mark.parametrize(("steps", "by"), [((4,), 4), ((4, 4), 4), ((4, 2), 4), ((0,), 0)])
def test_a_process_is_nicer_than_its_parent_after_repeated_calls(steps: tuple[int, ...], by: int) -> None:
    assert niceness_after(*steps) == BEFORE + by


def test_the_niceness_is_at_most_the_systems_maximum() -> None:
    assert niceness_after(19) == min(BEFORE + 19, 19)


def test_a_process_that_has_exited_is_ignored() -> None:
    lower_priority(NOBODY, 5)


async def test_workers_have_a_priority_between_service_and_cameras() -> None:
    process = await start_worker("server.service.rendering.worker")
    try:
        assert BEFORE < niceness(process.pid) < BEFORE + 10
    finally:
        process.kill()
        await process.wait()


def test_a_camera_started_without_a_supervisor_is_nicer(tmp_path: Path) -> None:
    bus = f"tcp/127.0.0.1:{free_port()}"
    content = {
        "site": {"niceness": 3},
        "cameras": [{"id": "c0", "source": "scene:room"}],
        "sync": {"port": free_port()},
        "zenoh": {"connect": bus, "listen": bus},
    }
    path = tmp_path / "site.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    camera = subprocess.Popen([sys.executable, "-m", "server.cli.main", "camera", str(path), "c0"])
    try:
        until = time.monotonic() + PATIENCE
        while niceness(camera.pid) != BEFORE + 3:
            assert time.monotonic() < until
            assert camera.poll() is None
            time.sleep(0.05)
    finally:
        camera.kill()
        camera.wait()
