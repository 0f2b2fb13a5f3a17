"""A calibration is written into the configuration from the page; a restart brings it into force."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from fakes.service.scripted_cameras import FedService, small_config
from fakes.timeouts import PATIENCE
from server.config.loader import load_config
from server.config.running_config import ConfigFileState
from server.config.sections import HttpSettings
from server.http.access.csrf import CSRF_HEADER
from server.http.app import make_app, serving
from server.http.app_keys import SiteControl
from server.service.calibration.walk_session import WalkState
from server.service.calibration.worker import CalibrationResult
from server.service.service import BestViewService

GROUND = '{"unit": "m", "homography": {"c0": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}}'
RESTART, WALK = "/api/operator/restart", "/api/operator/walk"
CHANGED = ConfigFileState("", ("cameras.c0.ground",))


@asynccontextmanager
async def served(
    control: SiteControl, found: ConfigFileState = CHANGED, result: CalibrationResult | None = None
) -> AsyncIterator[aiohttp.ClientSession]:
    """Serve a site, whose walk has a result, to an operator."""
    service = FedService(small_config())
    if result is not None:
        service.walk_session.state, service.walk_session.result = WalkState.DONE, result
    app = make_app(BestViewService(service), lambda: found, control)
    async with (
        asyncio.timeout(PATIENCE),
        serving(app, HttpSettings(port=0)) as port,
        aiohttp.ClientSession(f"http://127.0.0.1:{port}", headers={CSRF_HEADER: "1"}) as session,
    ):
        yield session
    service.close()


async def post(session: aiohttp.ClientSession, path: str, body: Any = None) -> tuple[int, Any]:
    async with session.post(path, json=body) as answer:
        return answer.status, await answer.json()


async def test_a_supervised_site_is_restarted_on_request() -> None:
    control = SiteControl(Path("site.yaml"), asyncio.Event(), refused="c0 does not fit")
    async with served(control) as session:
        async with session.get(RESTART) as answer:
            assert await answer.json() == {
                "possible": True,
                "error": "",
                "changed_keys": ["cameras.c0.ground"],
                "refused": "c0 does not fit",
            }
        assert not control.restart.is_set()
        assert (await post(session, RESTART))[0] == 200
        assert control.restart.is_set()


@pytest.mark.parametrize(
    ("control", "found", "error"),
    [
        (
            SiteControl(Path("site.yaml")),
            CHANGED,
            "restart all processes of the site where they were started",
        ),
        (
            SiteControl(Path("site.yaml"), asyncio.Event()),
            ConfigFileState("site.yaml: is wrong", ()),
            "is wrong",
        ),
    ],
)
async def test_a_restart_that_would_fail_is_refused(
    control: SiteControl, found: ConfigFileState, error: str
) -> None:
    async with served(control, found) as session:
        status, answer = await post(session, RESTART)
    assert status == 409
    assert error in answer["error"]


async def test_a_calibration_is_written_into_the_configuration(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    path.write_text("# mine\ncameras: [{id: c0, source: 'scene:room'}]\n")
    async with served(SiteControl(path), result=CalibrationResult(ground=GROUND)) as session:
        status, _ = await post(session, WALK, {"action": "apply"})
    assert status == 200
    assert load_config(path).camera("c0").ground is not None
    assert path.read_text().startswith("# mine\n")


@pytest.mark.parametrize(
    ("path", "result", "error"),
    [
        (None, CalibrationResult(ground=GROUND), "no configuration file"),
        (Path("/nowhere/site.yaml"), CalibrationResult(ground=GROUND), "No such file"),
        (Path("site.yaml"), CalibrationResult(error="too short"), "no calibration result"),
    ],
)
async def test_what_cannot_be_written_is_one_line(
    path: Path | None, result: CalibrationResult, error: str
) -> None:
    async with served(SiteControl(path), result=result) as session:
        status, answer = await post(session, WALK, {"action": "apply"})
    assert status == 409
    assert error in answer["error"]
    assert len(answer["error"].splitlines()) == 1
