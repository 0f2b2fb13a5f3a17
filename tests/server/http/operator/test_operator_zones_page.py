"""Zones are drawn on the operator's page by mouse or numbers, saved in the file, and report events."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import time
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Browser, Locator, Page, expect

from fakes.page.operator_page import PLAN, check_button_sizes, open_operator_page, serious_faults
from fakes.paths import AXE
from fakes.programs import needs_chromium
from fakes.service.fed_site import A, B, ServedSite, apply_saved_zones, show_people
from fakes.service.scripted_cameras import CAMERAS, HEIGHT, LARGE, SMALL, WIDTH
from server.config.loader import load_config
from server.http.app_keys import SiteControl

pytestmark = [
    needs_chromium,
    pytest.mark.asyncio(loop_scope="module"),
]

TEXT = "# mine\ncameras:  # both\n- {id: c0, source: 'scene:room'}\n- {id: c1, source: 'scene:room'}\n"
GROUNDS = [{"id": camera, "source": "scene:room", "ground": PLAN, "ground_unit": "m"} for camera in CAMERAS]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "site.yaml"
    path.write_text(TEXT)
    return path


@asynccontextmanager
async def open_zones(
    browser: Browser, path: Path, axe: str = "", **changes: Any
) -> AsyncIterator[tuple[ServedSite, Page]]:
    """Open the section of a site with people, which applies the zones and rules of its file on request."""
    served: list[ServedSite] = []
    control = SiteControl(path, reload=lambda: apply_saved_zones(path, served[0]))
    async with open_operator_page(
        browser, "#configuration", axe, patience=120, control=control, **changes
    ) as (site, page):
        served.append(site)
        show_people(site)
        await page.set_viewport_size({"width": 900, "height": 1400})  # all is in view
        await page.locator("#sections").get_by_role("link", name="Zones").click()
        yield site, page


async def press(page: Page, drawing: Locator, x: float, y: float) -> None:
    """Press at shares of a drawing's width and height."""
    box = await drawing.bounding_box()
    assert box is not None
    await page.mouse.click(box["x"] + x * box["width"], box["y"] + y * box["height"])


async def test_a_zone_drawn_in_a_picture_reports_who_enters_and_is_in_the_file(
    browser: Browser, path: Path
) -> None:
    async with open_zones(browser, path) as (served, page):
        await page.get_by_label("On", exact=True).select_option(A)
        await page.get_by_role("button", name="New area").click()
        drawing = page.locator("#zone-drawing")
        for x, y in ((0.5, 0.0), (0.99, 0.0), (0.99, 0.99), (0.4, 0.99)):
            await press(page, drawing, x, y)
        await expect(page.locator("#zone-corners tr")).to_have_count(4)
        last = drawing.locator('.grip.around[data-corner="3"]')
        box = await last.bounding_box()
        stage = await drawing.bounding_box()
        assert box is not None
        assert stage is not None
        await page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        await page.mouse.down()
        await page.mouse.move(stage["x"] + stage["width"] / 2, stage["y"] + stage["height"] - 2, steps=4)
        await page.mouse.up()
        await expect(page.locator("#zone-corners tr")).to_have_count(4)
        await page.locator("#zone-name").fill("right")
        await page.get_by_role("button", name="Add a rule").click()
        await page.get_by_role("button", name="Save").click()
        await expect(page.locator("#zone-state")).to_contain_text("Saved, and in force")
        await expect(page.locator("#zone-list li")).to_have_text(f"right, {A}no one")
        text = path.read_text()
        assert text.startswith(TEXT)
        config = load_config(path)
        (zone,), (rule,) = config.zones, config.rules
        assert (zone.id, zone.camera, rule.id, rule.kind) == ("right", A, "right-entered", "entered")
        assert zone.area is not None
        for (x, y), (wanted_x, wanted_y) in zip(
            zone.area, ((0.5, 0), (0.99, 0), (0.99, 0.99), (0.5, 1)), strict=True
        ):
            assert abs(x - wanted_x * WIDTH) < 1
            assert abs(y - wanted_y * HEIGHT) < 1
        assert [file.read_text() for file in path.parent.glob("site.2*.yaml")] == [TEXT]
        walks = (44.0, 10.0, 50.0, 28.0)
        for epoch in range(3, 9):
            served.service.feed(epoch, {A: {1: walks, 2: SMALL}, B: {1: LARGE}})
        await expect(page.locator("#zone-list li")).to_have_text(f"right, {A}1")
        await page.locator("#sections").get_by_role("link", name="Floor").click()
        await expect(page.locator("#rule-events li")).to_contain_text("right-entered: entered right: 1")


async def test_a_line_drawn_on_the_floor_is_turned_changed_and_removed(browser: Browser, path: Path) -> None:
    async with open_zones(browser, path, cameras=GROUNDS) as (_, page):
        drawing = page.locator("#zone-drawing")
        await expect(drawing.locator(".coverage")).to_have_count(2)
        await page.get_by_role("button", name="New line").click()
        await press(page, drawing, 0.4, 0.5)
        await press(page, drawing, 0.6, 0.5)
        await expect(drawing.locator(".direction")).to_have_count(1)
        await page.get_by_label("End 1, x").fill("2")
        await page.get_by_label("End 1, y").fill("3")
        await page.get_by_label("End 2, x").fill("4")
        await page.get_by_label("End 2, y").fill("3")
        await expect(page.get_by_label("Inner side, y")).to_have_value("3.5")
        await page.get_by_role("button", name="Turn the direction").click()
        await expect(page.get_by_label("Inner side, y")).to_have_value("2.5")
        await page.locator("#zone-name").fill("door")
        await page.get_by_role("button", name="Add a rule").click()
        await page.get_by_label("Direction of rule 1").select_option("inward")
        await page.get_by_label("Name of rule 1").fill("came-in")
        await page.keyboard.press("Enter")
        await expect(page.locator("#zone-state")).to_contain_text("Saved, and in force")
        config = load_config(path)
        (zone,), (rule,) = config.zones, config.rules
        assert (zone.line, zone.inner, zone.camera) == ([(2, 3), (4, 3)], (3, 2.5), None)
        assert (rule.id, rule.kind, rule.direction) == ("came-in", "crossed", "inward")
        await page.get_by_role("button", name="door, floor").click()
        await page.locator("#zone-name").fill("gate")
        await page.get_by_role("button", name="Remove rule 1").click()
        await page.get_by_role("button", name="Save").click()
        await expect(page.get_by_role("button", name="gate, floor")).to_be_visible()
        assert load_config(path).rules == []
        await page.get_by_role("button", name="gate, floor").click()
        await page.get_by_role("button", name="Remove the zone").click()
        await expect(page.locator("#zone-list li")).to_have_count(0)
        assert load_config(path).zones == []
        assert path.read_text().startswith(TEXT)


async def test_a_zone_is_made_with_the_keyboard_alone(browser: Browser, path: Path) -> None:
    async with open_zones(browser, path, cameras=GROUNDS) as (_, page):
        await expect(page.get_by_role("button", name="New area")).to_be_enabled()
        await page.get_by_role("button", name="New area").focus()
        await page.keyboard.press("Enter")
        await page.keyboard.type("till")
        for corner, (x, y) in enumerate(((0, 0), (2, 0), (2, 3)), 1):
            await page.get_by_role("button", name="Add a corner").focus()
            await page.keyboard.press("Enter")
            for axis, value in (("x", x), ("y", y)):
                await page.get_by_label(f"Corner {corner}, {axis}").focus()
                await page.keyboard.press("ControlOrMeta+a")
                await page.keyboard.type(str(value))
        await page.get_by_role("button", name="Add a rule").focus()
        await page.keyboard.press("Enter")
        await page.keyboard.type("There")
        await page.get_by_label("Limit of rule 1, people").focus()
        await page.keyboard.press("ControlOrMeta+a")
        await page.keyboard.type("2")
        await page.keyboard.press("Enter")
        await expect(page.locator("#zone-state")).to_contain_text("Saved, and in force")
        config = load_config(path)
        assert (config.zones[0].id, config.zones[0].area) == ("till", [(0, 0), (2, 0), (2, 3)])
        assert (config.rules[0].id, config.rules[0].more_than) == ("till-crowded", 2)


async def restrict(page: Page, rule: int, **values: str) -> None:
    """Fill in the fields that restrict a rule."""
    summary = page.locator("#zone-rules li").nth(rule - 1).locator("summary")
    await summary.focus()
    await page.keyboard.press("Enter")
    for label, value in values.items():
        await page.get_by_label(re.compile(rf"{label}.* rule {rule}|[Rr]ule {rule} applies {label}")).fill(
            value
        )


async def test_rules_have_schedules_people_and_clear_cameras_on_a_zone_and_anywhere(
    browser: Browser, path: Path
) -> None:
    rule = "{id: queue, kind: crowded, zone: till, more_than: 4, days: [sat, mon, tue], people: [Ann]}"
    zone = "zones:\n- {id: till, camera: c0, area: [[0, 0], [9, 0], [9, 9]], margin: 2.0}  # pay\n"
    path.write_text(f"{TEXT}{zone}rules:\n# at the till\n- {rule}  # mine\n")
    async with open_zones(browser, path) as (served, page):
        await page.get_by_role("button", name="till, c0").click()
        summary, state = page.locator("#zone-rules summary"), page.locator("#zone-state")
        await expect(summary).to_have_text("When and for whom: Mon\u2013Tue, Sat, for Ann")
        await page.get_by_role("button", name="Add a rule").click()
        await page.get_by_label("Rule 2", exact=True).select_option("stayed")
        await restrict(page, 2, People='3, "7"', to="06:00")
        await page.get_by_role("button", name="Save").click()
        start = page.get_by_label("Rule 2 applies from")
        await expect(start).to_be_focused()
        assert (
            await start.evaluate("(it) => it.validationMessage") == "Enter both times, or none for all day."
        )
        await start.fill("22:00")
        for day in ("Sat", "Sun"):
            await page.locator("#zone-rules li").nth(1).get_by_label(day).uncheck()
        await page.locator("#zone-rules li").nth(1).get_by_label("c1").check()
        await expect(summary.nth(1)).to_have_text(
            "When and for whom: Mon\u2013Fri, 22:00 to 06:00 of the next day, for 3, 7, while c1 is clear"
        )
        await page.get_by_role("button", name="Save").click()
        await expect(state).to_contain_text("Saved, and in force")
        assert f"# at the till\n- {rule}  # mine\n" in path.read_text()
        assert zone in path.read_text()
        queue, stayed = served.service.config.rules
        assert queue.days == ["sat", "mon", "tue"]
        assert (stayed.id, stayed.kind, stayed.longer_than_s) == ("till-stayed", "stayed", 60)
        assert (stayed.people, stayed.days) == ([3, "7"], ["mon", "tue", "wed", "thu", "fri"])
        assert (stayed.hours, stayed.cameras) == ((time(22), time(6)), ["c1"])
        await page.get_by_role("button", name="Rules anywhere").click()
        await expect(page.locator("#zone-name")).to_be_hidden()
        await page.get_by_role("button", name="Add a rule").click()
        await page.get_by_label("Rule 1", exact=True).select_option("close")
        await page.get_by_label("Rule 1 must last, seconds").fill("2.5")
        await page.get_by_role("button", name="Save").click()
        await expect(state).to_contain_text("Saved, and in force")
        close = served.service.config.rules[2]
        assert (close.id, close.zone, close.closer_than_m, close.hold_s) == ("site-close", None, 1.5, 2.5)
        await page.get_by_role("button", name="Rules anywhere").click()
        path.write_text(
            path.read_text().replace("closer_than_m: 1.5", "closer_than_m: 2")
        )  # by another operator
        await page.get_by_role("button", name="Save").click()
        await expect(state).to_contain_text(
            "Somebody else has changed these rules meanwhile. What is entered here is kept"
        )
        await page.get_by_role("button", name="Cancel").click()
        await page.get_by_role("button", name="Rules anywhere").click()
        await expect(page.get_by_label("Limit of rule 1, meters")).to_have_value("2")
        await restrict(page, 1)
        await page.get_by_role("button", name="Remove rule 1").click()
        await page.get_by_role("button", name="Save").click()
        await expect(state).to_contain_text("Saved, and in force")
        assert [each.id for each in load_config(path).rules] == ["queue", "till-stayed"]


async def test_an_invalid_entry_of_a_rule_is_one_line_at_its_field(browser: Browser, path: Path) -> None:
    path.write_text(
        f"{TEXT}zones:\n- {{id: till, camera: c0, area: [[0, 0], [9, 0], [9, 9]]}}\n"
        "rules: [{id: other, kind: entered}]\n"
    )
    before = path.read_text()
    async with open_zones(browser, path) as (_, page):
        await page.get_by_role("button", name="till, c0").click()
        await page.get_by_role("button", name="Add a rule").click()
        await page.get_by_label("Rule 1", exact=True).select_option("stayed")
        await restrict(page, 1)
        details = page.locator("#zone-rules details")
        for label, values in (
            (
                "Name of rule 1",
                {"a b": "Use letters, digits, _ and -", "other": "Another rule is called other."},
            ),
            (
                "Limit of rule 1, seconds",
                {"0": "Enter more than 0.", "86401": "86400", "-1": "0", "": "fill out"},
            ),
            ("People of rule 1", {"3,,": "Enter numbers or names with commas", '"Ann': "Enter numbers"}),
            ("Rule 1 applies to", {"06:00": "Enter both times, or none for all day."}),
        ):
            field = page.get_by_label(label)
            usual = await field.input_value()
            for value, message in values.items():
                await details.evaluate("(it) => { it.open = true; }")
                await field.fill(value)
                await details.evaluate("(it) => { it.open = false; }")
                await page.get_by_role("button", name="Save").click()
                invalid = page.locator("#zone-form input:invalid")
                await expect(invalid).to_be_focused()
                assert message in await invalid.evaluate("(it) => it.validationMessage")
            await field.fill(usual)
        for box in await details.locator("fieldset").first.get_by_role("checkbox").all():
            await box.uncheck()
        await page.get_by_role("button", name="Save").click()
        monday = page.locator("#zone-rules").get_by_label("Mon")
        await expect(monday).to_be_focused()
        assert await monday.evaluate("(it) => it.validationMessage") == "Choose at least one day."
        await monday.check()
        await page.locator("#zone-rules li").evaluate(
            "(it) => { it.querySelector('select').add(new Option('wave')); }"
        )
        await page.get_by_label("Rule 1", exact=True).select_option("wave")
        await page.get_by_role("button", name="Save").click()
        await expect(page.locator("#zone-rules li .error-message")).to_contain_text(
            "kind: Input should be 'entered'"
        )
        assert path.read_text() == before


async def test_what_the_loader_refuses_is_shown_and_what_was_drawn_stays(
    browser: Browser, path: Path
) -> None:
    async with open_zones(browser, path) as (_, page):
        await page.get_by_role("button", name="New area").click()
        await press(page, page.locator("#zone-drawing"), 0.2, 0.2)
        await page.locator("#zone-name").fill("till")
        await page.get_by_role("button", name="Save").click()
        await expect(page.locator("#zone-state")).to_contain_text(
            "the zone: area: List should have at least 3 items"
        )
        await expect(page.locator("#zone-corners tr")).to_have_count(1)
        assert path.read_text() == TEXT
        await page.get_by_role("button", name="Cancel").click()
        await expect(page.locator("#zone-form")).to_be_hidden()


async def test_without_a_file_zones_are_shown_and_cannot_be_changed(browser: Browser) -> None:
    zone = {"id": "till", "camera": "c0", "area": [[0, 0], [9, 0], [9, 9]]}
    async with open_operator_page(browser, "#zones", control=SiteControl(), zones=[zone]) as (served, page):
        show_people(served)
        await page.reload()
        await expect(page.locator("#zones-unavailable")).to_contain_text(
            "this service has no configuration file"
        )
        await expect(page.locator("#zone-drawing .zone")).to_have_count(1)
        for name in ("New area", "New line", "till, c0"):
            await expect(page.get_by_role("button", name=name)).to_be_disabled()


async def test_the_open_form_fits_every_width_and_axe_finds_no_serious_violation(
    browser: Browser, path: Path
) -> None:
    axe = AXE.read_text(encoding="utf-8") if AXE.exists() else ""
    async with open_zones(browser, path, axe, cameras=GROUNDS) as (_, page):
        await page.get_by_role("button", name="New area").click()
        for x, y in ((0.4, 0.4), (0.6, 0.4), (0.6, 0.6)):
            await press(page, page.locator("#zone-drawing"), x, y)
        for number, kind in enumerate(("entered", "left", "stayed", "crowded", "close"), 1):
            await page.get_by_role("button", name="Add a rule").click()
            await page.get_by_label(f"Rule {number}", exact=True).select_option(kind)
        for number in range(1, 6):
            await restrict(page, number, People="Ann", to="06:00")
        for width in (360, 800, 1600):
            await page.set_viewport_size({"width": width, "height": 800})
            assert await page.evaluate("document.documentElement.scrollWidth") <= width
            if width == 360:
                await check_button_sizes(page)
            if axe:
                assert await serious_faults(page) == []
    if not axe:
        pytest.skip("axe-core is not there: make node_modules/.installed")
