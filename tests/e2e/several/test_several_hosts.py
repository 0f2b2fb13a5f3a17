"""Services, pulse server and cameras on hosts of a real network, one of which is cut off."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from benchmarks.common.network_hosts import CannotMakeHostsError, NetworkHosts, network_hosts
from client import watch
from fakes.running.several_services import FPS, Watcher, configuration, several_services, watching
from fakes.timeouts import PATIENCE

_OPEN = {"trusted_network": True, "open_to_all": True}


@pytest.fixture
def hosts() -> Iterator[NetworkHosts]:
    try:
        with network_hosts("one", "two", "cameras") as made:
            yield made
    except CannotMakeHostsError as error:
        pytest.skip(f"needs network namespaces, as Docker does: {error}")


@pytest.mark.slow
async def test_a_service_whose_host_is_cut_off_is_replaced(tmp_path: Path, hosts: NetworkHosts) -> None:
    address = hosts.addresses
    config = configuration(
        tmp_path,
        hosts=[address["one"], address["two"]],
        sync={"host": address["cameras"], "bind": address["cameras"]},
        access=_OPEN,
    )
    prefixes = {
        "bestview-0": hosts.within("one"),
        "bestview-1": hosts.within("two"),
        "sync": hosts.within("cameras"),
        "cameras": hosts.within("cameras"),
    }
    async with asyncio.timeout(PATIENCE), several_services(config, prefixes) as site:
        await site.numbers(0)
        async with watching(site.urls[1]) as survivor:
            await survivor.until(round(10 * FPS))  # the services agree
            number = (await site.numbers(1))[0]
            recording = asyncio.create_task(watch(site.urls[0], number, tmp_path / "one.mp4", 12.0))
            await survivor.until(survivor.last_pulse + round(3 * FPS))
            hosts.cut("one")
            cut_at = survivor.last_pulse
            await survivor.until(cut_at + round(6 * FPS))
            assert longest_without_boxes(survivor, cut_at) <= 3 * FPS, "the cameras still reach the survivor"
            hosts.cut("one", is_cut=False)
            result = await recording
            assert (result.complete, result.reconnections > 0) == (True, True)
            assert survivor.has_every_pulse()
            async with watching(site.urls[0]) as returned:
                await returned.until(survivor.last_pulse + round(4 * FPS))
                while not agree(returned, survivor):
                    await returned.until(returned.last_pulse + 1)
                    await survivor.until(returned.last_pulse)


def longest_without_boxes(watched: Watcher, since: int) -> int:
    """Return the most pulses in a row without anybody's box, at a service that decides on."""
    shown = [gop.first for _, gop in watched.gops if gop.first > since and any(map(any, gop.boxes.values()))]
    return max(after - before for before, after in pairwise([since, *shown, watched.last_pulse]))


def agree(one: Watcher, other: Watcher) -> bool:
    """Return whether two services have shown the same numbers in the boxes of their last common GOP."""
    boxes = [{gop.first: gop.boxes for _, gop in watched.gops} for watched in (one, other)]
    last = max(boxes[0].keys() & boxes[1].keys(), default=None)
    return last is not None and boxes[0][last] == boxes[1][last]
