"""Selecting a person: by default, click, key, link, and in the picture."""

from __future__ import annotations

import pytest
from playwright.async_api import Browser, expect

from fakes.page.browser import Visit, visiting
from fakes.page.site import FakeSite
from fakes.page.video_pattern import CAMERAS, HEIGHT, SQUARE, WIDTH
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]

# The last frame before a pause may not be displayed yet.
SOME_REFRESHES = "(async () => { for (let n = 0; n < 9; n++) await new Promise(requestAnimationFrame); })()"


async def test_opens_on_the_first_person_in_view(browser: Browser) -> None:
    async with visiting(browser, FakeSite(people={1: False, 2: True})) as visit:
        await visit.playing(2)
        assert visit.page.url.endswith("?object=2")
        assert await visit.page.title() == "Person 2 · MyView"


async def test_every_person_has_a_card_with_number_picture_and_cameras(browser: Browser) -> None:
    async with visiting(browser, FakeSite(people={1: True, 2: False})) as visit:
        cards = visit.page.locator("nav .person")
        await expect(cards).to_have_count(2)
        await expect(cards.nth(0)).to_have_accessible_name("Person 1, seen by c0, c1")
        await expect(cards.nth(1)).to_have_accessible_name("Person 2, not in view")
        await expect(cards.nth(0)).to_have_attribute("aria-current", "true")
        await visit.until(
            "[...document.querySelectorAll('.person img')].every((image) => image.naturalWidth > 0)"
        )


async def test_a_link_opens_on_its_person(browser: Browser) -> None:
    async with visiting(browser, query="?object=2") as visit:
        await visit.playing(2)
        assert visit.server.site.opened == [2]


async def test_a_person_selected_again_during_a_switch_is_shown(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        press = "document.querySelector(`#people li[data-object='${number}'] .person`).click()"
        await visit.get(f"[2, 1, 2].forEach((number) => {press})")
        await visit.playing(2)
        first, _, last = await visit.get("myview.switches.slice(-3)")
        assert (first["object"], first["shownAt"]) == (2, None)
        assert last["object"] == 2
        assert last["shownAt"] > last["chosenAt"]


async def test_a_click_switches_and_keeps_the_player(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.get("window.before = [video, video.currentSrc, performance.timeOrigin]")
        for person in (2, 1, 2):
            await visit.page.get_by_role("button", name=f"Person {person},").click()
            await visit.playing(person)
        kept = "[video, video.currentSrc, performance.timeOrigin].every((now, i) => now === window.before[i])"
        assert await visit.get(kept)
        took = await visit.get("myview.switches.slice(-3).map((it) => it.shownAt - it.chosenAt)")
        assert 0 < min(took) <= max(took) < 10_000  # ten times the target of an idle machine
        assert visit.page.url.endswith("?object=2")
        await visit.page.go_back()
        await visit.playing(1)


async def test_after_a_switch_only_the_new_person_is_shown(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.page.get_by_role("button", name="Person 2,").click()
        await visit.playing(2)
        shown = await visit.get("myview.pulse")
        await visit.until(f"myview.pulse > {shown + 40}")
        assert await visit.get(f"myview.cuts.filter((cut) => cut.pulse > {shown}).length") == 0
        assert await visit.get("myview.camera") == CAMERAS[2]


async def test_people_are_selected_by_keyboard(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.page.keyboard.press("ArrowRight")
        await visit.playing(2)
        await visit.page.keyboard.press("ArrowRight")
        await visit.playing(1)
        await visit.page.get_by_role("button", name="Person 2,").focus()
        await visit.page.keyboard.press("Enter")
        await visit.playing(2)
        focused = "document.activeElement.title"
        assert (await visit.get(focused)).startswith("Person 2,")


async def second_person_position(visit: Visit) -> list[float]:
    """Return where person 2 is in the displayed frame, in CSS pixels of the window."""
    return await visit.get(
        f"""(() => {{
          const stage = document.querySelector('#stage').getBoundingClientRect();
          const [camera, pulse] = [{list(CAMERAS)}.indexOf(myview.camera), myview.pulse];
          const step = (pulse + 37 * camera) % 100;
          const left = {WIDTH - SQUARE} - (4 + 14 * (step % 20));
          const top = {HEIGHT - SQUARE} - (20 + 40 * Math.floor(step / 20));
          const scale = stage.width / {WIDTH};
          return [stage.x + (left + 14) * scale, stage.y + (top + 14) * scale];
        }})()"""
    )


async def test_a_click_on_a_person_in_the_picture_selects_them(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.until("myview.delays.length > 5")
        await visit.get("video.pause()")
        await visit.get(SOME_REFRESHES)
        # A busy browser may still display a further frame, in which the person is elsewhere.
        while await visit.get("myview.object") != 2:
            await visit.page.mouse.click(*await second_person_position(visit))
        await visit.playing(2)


async def test_an_empty_site_says_so_and_plays_when_a_person_appears(browser: Browser) -> None:
    async with visiting(browser, FakeSite(people={})) as visit:
        status = visit.page.get_by_role("status")
        await expect(status).to_contain_text("No people yet")
        assert await visit.get("myview.state") == "empty"
        visit.server.site.people[1] = True
        await visit.playing(1)
        await expect(status).to_have_text("")


async def test_a_link_to_an_unknown_person_waits_for_them(browser: Browser) -> None:
    async with visiting(browser, query="?object=7") as visit:
        await expect(visit.page.get_by_role("status")).to_contain_text("Person 7 is not here")
        assert visit.server.site.opened == []
        visit.server.site.people[7] = True
        await visit.playing(7)


async def test_when_the_person_leaves_the_page_says_so_and_keeps_the_picture(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        visit.server.site.people[1] = False
        await visit.until("myview.state === 'away'")
        await expect(visit.page.get_by_role("status")).to_contain_text("Person 1 is out of view")
        await expect(visit.page.locator("#stage")).to_have_class("stage pictured")
        visit.server.site.people[1] = True
        await visit.playing(1)
