"""Containers that are killed, paused, restarted and cut off from each other while viewers watch."""

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
    # A viewer whose time is up while it connects leaves the connection to the collector, aiohttp does.
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

BY_NAME = {fault.name: fault for fault in FAULTS}


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, FaultOutcome]:
    """Inject all of them into one site, one after the other; after each it must have recovered."""
    missing = missing_requirement()
    if missing is not None:
        pytest.skip(missing)
    found = asyncio.run(measure(list(FAULTS), tmp_path_factory.mktemp("faults"), Report()))
    gc.collect()  # here, where it is let pass, not in whichever test the collector comes to next
    return {outcome.fault.name: outcome for outcome in found}


@pytest.mark.parametrize("name", BY_NAME)
def test_the_site_recovers(outcomes: dict[str, FaultOutcome], name: str) -> None:
    assert not outcomes[name].failed


@pytest.mark.parametrize("name", [name for name, fault in BY_NAME.items() if not fault.kills_server])
def test_a_stream_survives_everything_but_its_own_server(
    outcomes: dict[str, FaultOutcome], name: str
) -> None:
    assert outcomes[name].reconnections == 0


@pytest.mark.parametrize("name", [name for name, fault in BY_NAME.items() if fault.kills_server])
def test_a_stream_is_back_when_its_server_is(outcomes: dict[str, FaultOutcome], name: str) -> None:
    assert outcomes[name].recovery_s is not None


@pytest.mark.parametrize("name", BY_NAME)
def test_no_picture_and_no_box_is_a_wrong_one(outcomes: dict[str, FaultOutcome], name: str) -> None:
    outcome = outcomes[name]
    assert sum(viewer.frames for viewer in outcome.received), "there is something to be wrong"
    assert [note for viewer in outcome.received for note in viewer.notes] == []


@pytest.mark.parametrize("name", [name for name in BY_NAME if name.startswith("restart")])
def test_who_is_told_to_end_ends_by_itself(outcomes: dict[str, FaultOutcome], name: str) -> None:
    (exits,) = outcomes[name].exits
    assert exits.code == 0
