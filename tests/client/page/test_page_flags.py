"""Flags on the viewer's page, and pointing at people to answer them."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.async_api import Browser, expect

from fakes.page.accessibility import violations
from fakes.page.browser import Visit, play_for, visiting
from fakes.page.site import FakeSite
from fakes.page.video_pattern import CAMERAS, HEIGHT, WIDTH
from fakes.paths import AXE
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]


def flag(site: FakeSite, seconds: float = 60.0, **changes: Any) -> dict[str, Any]:
    pulse = site.edge + round(25 * seconds)
    content = {"objects": [2, 1], "cameras": [CAMERAS[2]], "reason": "crossing", "pulse": pulse}
    return {"id": 1, "raised": site.edge, "margin": 0.5, "risk": 0.5, "state": "raised", **content, **changes}


def corrections(site: FakeSite) -> list[dict[str, float]]:
    return [correction for batch in site.pointed for correction in batch["corrections"]]


async def center(visit: Visit, person: int) -> tuple[float, float, float, float]:
    """Return the center of a person's box: x, y on the page, and x, y in the picture."""
    await visit.until(f"myview.boxes.some(([object]) => object === {person})")
    left, top, right, bottom = await visit.get(
        f"myview.boxes.find(([object]) => object === {person}).slice(1)"
    )
    x, y = (left + right) / 2, (top + bottom) / 2
    box = await visit.page.locator("#boxes").bounding_box()
    assert box is not None
    return box["x"] + x * box["width"] / WIDTH, box["y"] + y * box["height"] / HEIGHT, x, y


async def test_viewers_see_flags_without_a_button(browser: Browser) -> None:
    site = FakeSite()
    site.flags.append(flag(site))
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        await expect(visit.page.locator("#flag-text")).to_have_text("2 and 1 look alike and cross")
        await visit.until("/ in [0-9.]+ s/.test(document.querySelector('#flag-time').textContent)")
        await expect(visit.page.locator("#flag-point")).to_be_hidden()
        await expect(visit.page.locator("#point")).to_be_hidden()
        await visit.page.keyboard.press("h")
        assert await visit.get("myview.pointing.object") is None
        site.flags.append(flag(site, state="expired"))
        await expect(visit.page.locator("#flags")).to_be_hidden()


async def test_an_operator_points_in_the_picture_of_the_flags_camera(browser: Browser) -> None:
    site = FakeSite(operates=True)
    site.flags.append(flag(site))
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        await visit.page.locator("#flag-point").click()
        await visit.playing(2)
        await visit.until(f"myview.camera === '{CAMERAS[2]}'")
        page_x, page_y, x, y = await center(visit, 2)
        await visit.page.mouse.move(page_x, page_y)
        await visit.until("myview.pointing.accepted >= 5")
        assert {(batch["object"], batch["camera"]) for batch in site.pointed} == {(2, CAMERAS[2])}
        pulses = [correction["pulse"] for correction in corrections(site)]
        assert pulses == sorted(set(pulses)), "one per frame"
        last = corrections(site)[-1]
        assert (last["x"], last["y"]) == pytest.approx((x, y), abs=1.0)
        assert 0 < last["tolerance"] < WIDTH / 4
        await visit.page.mouse.click(page_x, page_y)
        assert await visit.get("myview.object") == 2, "a press adds a correction and selects no one"
        site.flags.append(flag(site, state="answered"))
        await visit.until("myview.pointing.object === null")
        await expect(visit.page.locator("#automatic")).to_be_hidden()
        await expect(visit.page.locator("#cross")).to_be_hidden()


async def test_a_past_flag_is_answered_in_the_past_and_playback_returns_to_live(browser: Browser) -> None:
    site = FakeSite(operates=True)
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        await play_for(visit, 6)
        past = flag(site, -5.0)
        site.flags.append(past)
        await visit.until("/ [0-9] s ago/.test(document.querySelector('#flag-time').textContent)")
        await visit.page.locator("#flag-point").click()
        await visit.playing(2)
        went_back = "(delay, at, all) => at && delay.pulse < all[at - 1].pulse - 2 * 25"
        before = f"(delay) => delay.pulse < {past['pulse']}"
        await visit.until(f"myview.delays.filter({went_back}).some({before})")
        await visit.until(f"myview.camera === '{CAMERAS[2]}'")
        await expect(visit.page.locator("#live")).to_be_visible()
        page_x, page_y, *_ = await center(visit, 2)
        await visit.page.mouse.move(page_x, page_y)
        await visit.until("myview.pointing.accepted >= 5")
        # The correction is of the past, however long it took to move the pointer.
        assert past["pulse"] - 2 * 25 < corrections(site)[0]["pulse"] < site.edge - 3 * 25
        await visit.page.keyboard.press("Escape")
        await expect(visit.page.locator("#live")).to_be_hidden()
        await visit.until("myview.delays.at(-1).delayMs < 3000")
        await expect(visit.page.locator("#automatic")).to_be_hidden()


async def test_while_pointing_the_persons_flag_is_shown_even_if_another_is_more_urgent(
    browser: Browser,
) -> None:
    site = FakeSite(operates=True)
    site.flags.append(flag(site))
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        await visit.page.locator("#flag-point").click()
        text = visit.page.locator("#flag-text")
        await expect(text).to_have_text("Follow 2: 2 and 1 look alike and cross")
        site.flags.append(flag(site, 20.0, id=2, objects=[3], reason="track_loss"))
        await visit.until("myview.flags.length === 2 && myview.flags[0].id === 2")
        await expect(text).to_have_text("Follow 2: 2 and 1 look alike and cross")
        await visit.page.locator("#flag-point").click()
        await expect(text).to_have_text("3 may be lost")


async def test_the_operator_points_at_the_selected_person_by_keyboard(browser: Browser) -> None:
    site = FakeSite(operates=True)
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        await visit.until("!document.querySelector('#point').hidden")
        await visit.page.keyboard.press("h")
        await expect(visit.page.locator("#flag-text")).to_have_text("Follow 1")
        await visit.page.keyboard.press("Space")
        await visit.until("document.querySelector('video').paused && myview.boxes.length > 0")
        *_, x, y = await center(visit, 1)
        await visit.page.keyboard.press("ArrowRight")
        await visit.page.keyboard.press("ArrowLeft")
        before = len(site.pointed)
        await visit.page.keyboard.press("Enter")
        await visit.until(f"myview.pointing.accepted > {before}")
        assert await visit.get("myview.object") == 1, "arrows move the cross"
        last = corrections(site)[-1]
        assert (last["x"], last["y"]) == pytest.approx((x, y), abs=WIDTH / 8)
        await visit.page.keyboard.press("Escape")
        await visit.until("myview.pointing.object === null")


async def test_the_operator_points_at_the_selected_person_while_a_flag_is_about_others(
    browser: Browser,
) -> None:
    site = FakeSite(operates=True)
    site.flags.append(flag(site, objects=[2], reason="track_loss"))
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        await visit.until("!document.querySelector('#point').hidden && myview.flags.length === 1")
        await visit.page.keyboard.press("h")
        await expect(visit.page.locator("#flag-text")).to_have_text("Follow 1")
        assert await visit.get("[myview.object, myview.pointing.object]") == [1, 1]
        await expect(visit.page.locator("#automatic")).to_be_hidden()  # no camera is held for the flag
        await visit.page.keyboard.press("h")
        await expect(visit.page.locator("#flag-text")).to_have_text("2 may be lost")


async def test_pointing_started_by_key_continues_when_a_flag_is_answered(browser: Browser) -> None:
    site = FakeSite(operates=True)
    site.flags.append(flag(site, objects=[1, 2]))
    async with visiting(browser, site) as visit:
        await visit.playing(1)
        await visit.until("!document.querySelector('#point').hidden && myview.flags.length === 1")
        await visit.page.keyboard.press("h")
        site.flags.append(flag(site, objects=[1, 2], state="answered"))
        await visit.until("myview.flags.length === 0")
        assert await visit.get("myview.pointing.object") == 1, "the first correction may be wrong"
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
async def test_a_flag_causes_no_accessibility_faults(browser: Browser, width: int) -> None:
    site = FakeSite(operates=True)
    site.flags.append(flag(site))
    async with visiting(browser, site, width=width) as visit:
        await visit.playing(1)
        await expect(visit.page.locator("#flag-point")).to_be_visible()
        assert await violations(visit) == []
        await visit.page.locator("#flag-point").click()
        await visit.until("myview.pointing.object === 2")
        assert await violations(visit) == []
