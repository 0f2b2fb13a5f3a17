"""Flags on the page: everybody sees what may go wrong, and the operator's pointer says who is where."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.async_api import Browser, expect

from fakes.page.accessibility import faults
from fakes.page.browser import Visit, seconds_of_playing, visiting
from fakes.page.site import FakeSite
from fakes.page.video_pattern import CAMERAS, HEIGHT, WIDTH
from fakes.paths import AXE
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]


def flag(site: FakeSite, seconds: float = 60.0, **changes: Any) -> dict[str, Any]:
    pulse = site.edge + round(25 * seconds)
    told = {"objects": [2, 1], "cameras": [CAMERAS[2]], "reason": "crossing", "pulse": pulse}
    return {"id": 1, "raised": site.edge, "margin": 0.5, "risk": 0.5, "state": "raised", **told, **changes}


def points(site: FakeSite) -> list[dict[str, float]]:
    return [point for said in site.pointed for point in said["corrections"]]


async def middle(visit: Visit, person: int) -> tuple[float, float, float, float]:
    """Return the middle of a person's box: on the page, and in the picture."""
    await visit.until(f"myview.boxes.some(([it]) => it === {person})")
    left, top, right, bottom = await visit.get(f"myview.boxes.find(([it]) => it === {person}).slice(1)")
    x, y = (left + right) / 2, (top + bottom) / 2
    box = await visit.page.locator("#boxes").bounding_box()
    assert box is not None
    return box["x"] + x * box["width"] / WIDTH, box["y"] + y * box["height"] / HEIGHT, x, y


async def test_whoever_watches_sees_a_flag_and_when_and_no_button(browser: Browser) -> None:
    site = FakeSite()
    site.flags.append(flag(site))
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        await expect(visit.page.locator("#flag-words")).to_have_text("2 and 1, alike, cross")
        await visit.until("/ in [0-9.]+ s/.test(document.querySelector('#flag-when').textContent)")
        await expect(visit.page.locator("#flag-point")).to_be_hidden()
        await expect(visit.page.locator("#point")).to_be_hidden()
        await visit.page.keyboard.press("h")
        assert await visit.get("myview.pointing.object") is None
        site.flags.append(flag(site, state="expired"))
        await expect(visit.page.locator("#flags")).to_be_hidden()


async def test_the_pointer_is_followed_in_the_picture_of_the_camera_in_doubt(browser: Browser) -> None:
    site = FakeSite(operates=True)
    site.flags.append(flag(site))
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        await visit.page.locator("#flag-point").click()
        await visit.playing(2)
        await visit.until(f"myview.camera === '{CAMERAS[2]}'")
        there, down, x, y = await middle(visit, 2)
        await visit.page.mouse.move(there, down)
        await visit.until("myview.pointing.accepted >= 5")
        assert {(it["object"], it["camera"]) for it in site.pointed} == {(2, CAMERAS[2])}
        told = [it["pulse"] for it in points(site)]
        assert told == sorted(set(told)), "every frame once"
        last = points(site)[-1]
        assert (last["x"], last["y"]) == pytest.approx((x, y), abs=1.0)
        assert 0 < last["tolerance"] < WIDTH / 4
        await visit.page.mouse.click(there, down)
        assert await visit.get("myview.object") == 2, "a press says where they are, and chooses nobody"
        site.flags.append(flag(site, state="answered"))
        await visit.until("myview.pointing.object === null")
        await expect(visit.page.locator("#automatic")).to_be_hidden()
        await expect(visit.page.locator("#cross")).to_be_hidden()


async def test_what_is_over_is_seen_again_to_point_at_it_and_then_what_happens_now(browser: Browser) -> None:
    site = FakeSite(operates=True)
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        await seconds_of_playing(visit, 6)
        over = flag(site, -5.0)
        site.flags.append(over)
        await visit.until("/ [0-9] s ago/.test(document.querySelector('#flag-when').textContent)")
        await visit.page.locator("#flag-point").click()
        await visit.playing(2)
        went_back = "(it, place, all) => place && it.pulse < all[place - 1].pulse - 2 * 25"
        before = f"(it) => it.pulse < {over['pulse']}"
        await visit.until(f"myview.delays.filter({went_back}).some({before})")
        await visit.until(f"myview.camera === '{CAMERAS[2]}'")
        await expect(visit.page.locator("#live")).to_be_visible()
        there, down, *_ = await middle(visit, 2)
        await visit.page.mouse.move(there, down)
        await visit.until("myview.pointing.accepted >= 5")
        # However long the pointer took to get there: the past is as far behind as it was.
        assert over["pulse"] - 2 * 25 < points(site)[0]["pulse"] < site.edge - 3 * 25
        await visit.page.keyboard.press("Escape")
        await expect(visit.page.locator("#live")).to_be_hidden()
        await visit.until("myview.delays.at(-1).delayMs < 3000")
        await expect(visit.page.locator("#automatic")).to_be_hidden()


async def test_who_follows_somebody_reads_what_for_though_another_flag_is_more_urgent(
    browser: Browser,
) -> None:
    site = FakeSite(operates=True)
    site.flags.append(flag(site))
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        await visit.page.locator("#flag-point").click()
        words = visit.page.locator("#flag-words")
        await expect(words).to_have_text("Follow 2: 2 and 1, alike, cross")
        site.flags.append(flag(site, 20.0, id=2, objects=[3], reason="track_loss"))
        await visit.until("myview.flags.length === 2 && myview.flags[0].id === 2")
        await expect(words).to_have_text("Follow 2: 2 and 1, alike, cross")
        await visit.page.locator("#flag-point").click()
        await expect(words).to_have_text("3 fades, or is lost from sight")


async def test_by_keyboard_one_can_point_at_whoever_is_watched(browser: Browser) -> None:
    site = FakeSite(operates=True)
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        await visit.until("!document.querySelector('#point').hidden")
        await visit.page.keyboard.press("h")
        await expect(visit.page.locator("#flag-words")).to_have_text("Follow 1")
        await visit.page.keyboard.press("Space")
        await visit.until("document.querySelector('video').paused && myview.boxes.length > 0")
        *_, x, y = await middle(visit, 1)
        await visit.page.keyboard.press("ArrowRight")
        await visit.page.keyboard.press("ArrowLeft")
        before = len(site.pointed)
        await visit.page.keyboard.press("Enter")
        await visit.until(f"myview.pointing.accepted > {before}")
        assert await visit.get("myview.object") == 1, "arrows move the cross"
        last = points(site)[-1]
        assert (last["x"], last["y"]) == pytest.approx((x, y), abs=WIDTH / 8)
        await visit.page.keyboard.press("Escape")
        await visit.until("myview.pointing.object === null")


async def test_who_is_watched_can_be_pointed_at_while_a_flag_is_about_others(browser: Browser) -> None:
    site = FakeSite(operates=True)
    site.flags.append(flag(site, objects=[2], reason="track_loss"))
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        await visit.until("!document.querySelector('#point').hidden && myview.flags.length === 1")
        await visit.page.keyboard.press("h")
        await expect(visit.page.locator("#flag-words")).to_have_text("Follow 1")
        assert await visit.get("[myview.object, myview.pointing.object]") == [1, 1]
        await expect(visit.page.locator("#automatic")).to_be_hidden()  # no camera is held for the flag
        await visit.page.keyboard.press("h")
        await expect(visit.page.locator("#flag-words")).to_have_text("2 fades, or is lost from sight")


async def test_who_is_pointed_at_by_key_is_so_though_a_flag_is_answered(browser: Browser) -> None:
    site = FakeSite(operates=True)
    site.flags.append(flag(site, objects=[1, 2]))
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        await visit.until("!document.querySelector('#point').hidden && myview.flags.length === 1")
        await visit.page.keyboard.press("h")
        site.flags.append(flag(site, objects=[1, 2], state="answered"))
        await visit.until("myview.flags.length === 0")
        assert await visit.get("myview.pointing.object") == 1, "its first place may be wrong"
        await visit.page.keyboard.press("h")
        await visit.until("myview.pointing.object === null")


async def test_a_finger_points_while_it_is_down(browser: Browser) -> None:
    site = FakeSite(operates=True)
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        await visit.until("!document.querySelector('#point').hidden")
        await visit.page.locator("#point").click()

        async def touch(kind: str, buttons: int) -> None:
            at = f"clientX: 300, clientY: 200, buttons: {buttons}, bubbles: true"
            event = f"new PointerEvent('{kind}', {{ pointerType: 'touch', {at} }})"
            await visit.get(f"void document.querySelector('#boxes').dispatchEvent({event})")

        await touch("pointermove", 0)
        await expect(visit.page.locator("#cross")).to_be_hidden()
        await touch("pointerdown", 1)
        await visit.until("myview.pointing.accepted >= 2")
        await touch("pointerup", 0)
        await expect(visit.page.locator("#cross")).to_be_hidden()


@pytest.mark.skipif(not AXE.exists(), reason="needs axe-core: make node_modules/.installed")
@pytest.mark.parametrize("width", [360, 1600])
async def test_a_flag_is_no_obstacle(browser: Browser, width: int) -> None:
    site = FakeSite(operates=True)
    site.flags.append(flag(site))
    async with visiting(browser, site, width=width) as visit:
        await visit.playing(1)
        await expect(visit.page.locator("#flag-point")).to_be_visible()
        assert await faults(visit) == []
        await visit.page.locator("#flag-point").click()
        await visit.until("myview.pointing.object === 2")
        assert await faults(visit) == []
