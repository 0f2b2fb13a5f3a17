"""Containers that are killed, paused, restarted and disconnected while viewers watch."""

from __future__ import annotations

import asyncio
import gc

import pytest

from benchmarks.common.report import Report
from benchmarks.faults.containers import FAULTS
from benchmarks.faults.outcomes.fault_run import FaultOutcome
from benchmarks.faults.outcomes.measurement import measure
from benchmarks.faults.site.compose_site import missing_requirement

pytestmark = [
    pytest.mark.live,
    pytest.mark.slow,
    pytest.mark.timeout(1800),
    # aiohttp leaves the connection of a viewer that is cancelled while connecting to the garbage collector.
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

BY_NAME = {fault.name: fault for fault in FAULTS}


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, FaultOutcome]:
    """Inject all faults into one site, one after the other; it must recover after each."""
    missing = missing_requirement()
    if missing is not None:
        pytest.skip(missing)
    found = asyncio.run(measure(list(FAULTS), tmp_path_factory.mktemp("faults"), Report()))
    gc.collect()  # here, where the warning is ignored, rather than in a later test
    return {outcome.fault.name: outcome for outcome in found}


@pytest.mark.parametrize("name", BY_NAME)
def test_the_site_recovers(outcomes: dict[str, FaultOutcome], name: str) -> None:
    assert not outcomes[name].failed


@pytest.mark.parametrize("name", [name for name, fault in BY_NAME.items() if not fault.kills_server])
def test_a_stream_survives_everything_but_the_death_of_its_server(
    outcomes: dict[str, FaultOutcome], name: str
) -> None:
    assert outcomes[name].reconnections == 0


@pytest.mark.parametrize("name", [name for name, fault in BY_NAME.items() if fault.kills_server])
def test_a_stream_resumes_with_its_server(outcomes: dict[str, FaultOutcome], name: str) -> None:
    assert outcomes[name].recovery_s is not None


@pytest.mark.parametrize("name", BY_NAME)
def test_no_picture_and_no_box_is_wrong(outcomes: dict[str, FaultOutcome], name: str) -> None:
    outcome = outcomes[name]
    assert sum(viewer.frames for viewer in outcome.received), "pictures were received"
    assert [note for viewer in outcome.received for note in viewer.notes] == []


@pytest.mark.parametrize("name", [name for name in BY_NAME if name.startswith("restart")])
def test_a_terminated_container_exits_cleanly(outcomes: dict[str, FaultOutcome], name: str) -> None:
    (exits,) = outcomes[name].exits
    assert exits.code == 0
