"""The operator helps on the running demo: a flag is raised, a pointer follows, the camera takes it.

And it helps: beside the demo's cameras one shows two whom its tracker takes for each other. Pointed at by who
knows better, they have their numbers again.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import aiohttp
import pytest
import pytest_asyncio
import yaml
from playwright.async_api import Page
from running_site import RunningSite, running
from two_alike import FRAMES, MET, camera

from benchmarks.browser import CHROMIUM, chromium
from client import Gop
from client.model import Split
from server.run.setup import DEMO, free_port

pytestmark = [
    pytest.mark.live,
    pytest.mark.asyncio(loop_scope="module"),
    pytest.mark.timeout(200),
    pytest.mark.skipif(not CHROMIUM.exists(), reason=f"needs a Chromium at {CHROMIUM}"),
]
PATIENCE_MS = 60_000
ALIKE = "alike"


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def site(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[RunningSite]:
    """The demo, at a rate that a busy machine can do; whoever come near each other is a trouble."""
    bus = f"tcp/127.0.0.1:{free_port()}"
    folder = tmp_path_factory.mktemp("demo")
    content = {
        **DEMO,
        "cameras": [*DEMO["cameras"], camera(ALIKE, folder)],
        "site": {"name": "demo", "fps": 10, "width": 320, "height": 180},
        "sync": {"port": free_port(), "start_timeout_s": 60},
        "zenoh": {"connect": bus, "listen": bus},
        "http": {"port": free_port()},
        "track": {"assist": {"enabled": True, "alike": 1000.0, "margin": 100.0, "memory": FRAMES}},
        "view": {"flags": {"per_minute": 60, "risk": 0.0}},
    }
    path = folder / "demo.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    async with running(path) as site:
        await site.until(lambda: bool(site.gops and site.gops[-1].choices), "somebody is shown")
        yield site


@pytest_asyncio.fixture(loop_scope="module")
async def page(site: RunningSite) -> AsyncIterator[Page]:
    """The page, opened; an error in it fails the test."""
    errors: list[str] = []
    async with chromium() as browser:
        page = await browser.new_page(bypass_csp=True)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.set_default_timeout(PATIENCE_MS)
        await page.goto(site.url)
        yield page
    assert errors == []


PLACE = """(wanted) => {
  const box = myview.boxes.find(([object]) => object === (wanted ?? myview.pointing.object));
  if (!box) return null;
  const { left, top, width } = document.querySelector('#boxes').getBoundingClientRect();
  const scale = width / myview.site.width;
  return [left + scale * (box[1] + box[3]) / 2, top + scale * (box[2] + box[4]) / 2];
}"""


async def follow(page: Page, until: str) -> None:
    """Keep the pointer on whom it is to point at, as a hand or an eye would; answer what comes next."""
    async with asyncio.timeout(PATIENCE_MS / 1000):
        while not await page.evaluate(until):
            if await page.evaluate("myview.pointing.object === null && myview.flags.length > 0"):
                await page.keyboard.press("h")
            place = await page.evaluate(PLACE)
            if place is not None:
                await page.mouse.move(*place)
            pulse = await page.evaluate("myview.pulse")
            await page.wait_for_function(f"myview.pulse !== {pulse} || ({until})")


async def metric(site: RunningSite, name: str) -> float:
    async with aiohttp.ClientSession() as session, session.get(f"{site.url}metrics") as answer:
        lines = (await answer.text()).splitlines()
    return sum(float(line.split()[-1]) for line in lines if line.startswith(name))


def every_gop_once(site: RunningSite) -> bool:
    firsts = [gop.first for gop in site.gops]
    return firsts == list(range(firsts[0], firsts[0] + 10 * len(firsts), 10))


async def test_a_scripted_pointer_follows_a_flag_through_and_the_stream_goes_on(
    site: RunningSite, page: Page
) -> None:
    await page.wait_for_function("myview.state === 'playing'")
    await page.evaluate("document.querySelector('video').dataset.same = 'yes'")
    point = page.locator("#flag-point")
    await page.wait_for_function("myview.flags.length && !document.querySelector('#flag-point').hidden")
    assert (await page.locator("#flag-words").inner_text()).strip()
    await point.click()
    await page.wait_for_function("myview.pointing.object !== null")
    await follow(page, "myview.pointing.taken >= 20")
    sent = await metric(site, "myview_pointings_total")
    assert sent >= 20
    async with asyncio.timeout(PATIENCE_MS / 1000):  # the camera says so once a second
        while await metric(site, "myview_camera_pointings_total") < 1:
            await page.wait_for_function(f"myview.pulse > {await page.evaluate('myview.pulse')} + 5")
    async with aiohttp.ClientSession() as session, session.get(f"{site.url}api/flags") as answer:
        states = {it["state"] for it in (await answer.json())["flags"]}
    assert states & {"followed", "answered"}
    await page.keyboard.press("Escape")
    await page.wait_for_function("myview.pointing.object === null")
    pulse = await page.evaluate("myview.pulse")
    await page.wait_for_function(f"myview.state === 'playing' && myview.pulse > {pulse} + 10")
    assert await page.evaluate("document.querySelector('video').dataset.same") == "yes"
    assert every_gop_once(site)


def left_to_right(gop: Gop) -> list[int]:
    """Give who is shown by the camera of the two; empty where they change within the GOP."""
    rows = {tuple(it.object for it in sorted(row, key=lambda it: it.left)) for row in gop.boxes[ALIKE]}
    return list(rows.pop()) if len(rows) == 1 else []


async def test_who_is_pointed_at_has_their_number_again_and_the_stream_goes_on(
    site: RunningSite, page: Page
) -> None:
    """Who came from the left went back there; the tracker has the two pass each other."""
    gops = site.gops
    await site.until(lambda: gops[-1].first > MET, "they have met")
    came = [it for it in gops if it.first + it.frames <= MET and len(left_to_right(it)) == len("LR")]
    who, other = left_to_right(came[-1])
    await site.until(lambda: left_to_right(gops[-1]) == [other, who], "their tracker exchanges them")
    await page.goto(f"{site.url}?object={who}")
    await page.wait_for_function(f"myview.state === 'playing' && myview.camera === '{ALIKE}'")
    await page.evaluate("document.querySelector('video').dataset.same = 'yes'")
    await page.wait_for_function(f"!document.querySelector('#point').hidden && ({PLACE})({other})")
    await page.keyboard.press("h")
    await page.wait_for_function(f"myview.pointing.object === {who}")
    # They stand: the hand, too, stays where the one who came from the left is, whatever number is there.
    await page.mouse.move(*await page.evaluate(PLACE, other))
    await page.wait_for_function(
        "myview.pointing.taken >= 1"
    )  # an answered flag ends it sooner than the hand
    exchanged = {Split(who, other, ALIKE), Split(other, who, ALIKE)}
    async with asyncio.timeout(PATIENCE_MS / 1000):
        await site.until(lambda: any(exchanged <= {*it.split} for it in gops), "the camera solves anew")
    place = next(n for n, it in enumerate(gops) if exchanged <= {*it.split})
    assert left_to_right(gops[place - 1]) == [other, who], "what was told before stays"
    assert left_to_right(gops[place]) == [who, other], "what is told next is as they were before they met"
    assert gops[place].choices[who] == ALIKE
    # The page shows it, in the film that it has played all the time.
    left = f"myview.boxes.some(([it, left]) => it === {who} && left < myview.site.width / 2)"
    await page.wait_for_function(f"myview.pulse >= {gops[place].first} && {left}")
    await page.wait_for_function(f"myview.state === 'playing' && myview.pulse > {gops[place].first} + 10")
    assert await page.evaluate(left)
    assert await page.evaluate("document.querySelector('video').dataset.same") == "yes"
    assert every_gop_once(site)
