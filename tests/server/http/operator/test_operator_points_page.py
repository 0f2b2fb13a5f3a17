"""Cameras are calibrated by places that an operator marks in their pictures, and the result is written."""

from __future__ import annotations

import json
import re
from collections.abc import AsyncIterator
from contextlib import aclosing, asynccontextmanager
from pathlib import Path

import numpy as np
import pytest
from playwright.async_api import Browser, Page, expect

from fakes.page.operator_page import (
    check_button_sizes,
    open_operator_page,
    operator_page,
    press_picture,
    serious_faults,
)
from fakes.paths import AXE
from fakes.programs import needs_chromium
from fakes.service.drawn_site import drawn_room
from fakes.service.fed_site import A, B, show_people
from fakes.setup.room_points import HEIGHT, PLACES, WIDTH, error_of, image_of, pairs
from server.config.loader import load_config
from server.http.app_keys import SiteControl
from server.service.calibration.points_file import read_points
from server.setup.marked_points import apply_points

pytestmark = [
    needs_chromium,
    pytest.mark.asyncio(loop_scope="module"),
]

TEXT = "# mine\ncameras: [{id: c0, source: 'scene:room'}, {id: c1, source: 'scene:room'}]\n"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "site.yaml"
    path.write_text(TEXT)
    return path


@asynccontextmanager
async def room_page(browser: Browser, path: Path, axe: str = "") -> AsyncIterator[Page]:
    """Open the section on the synthetic room."""
    async with aclosing(drawn_room(SiteControl(path))) as sites:
        site = await anext(sites)
        async with operator_page(browser, site.port, "#calibration-points", axe) as page:
            picture = await page.locator("#points-image").element_handle()
            await page.wait_for_function("(it) => it.naturalWidth > 0", arg=picture)
            yield page


async def press(page: Page, camera: int, place: tuple[float, float]) -> None:
    """Press where a camera sees a place."""
    ((x, y),) = image_of(camera, place).tolist()
    await press_picture(page, (x, y), (WIDTH, HEIGHT))


async def enter(page: Page, place: int, x: str, y: str) -> None:
    await page.get_by_label(f"Place {place}, x on the floor").fill(x)
    await page.get_by_label(f"Place {place}, y on the floor").fill(y)


async def calibrate(page: Page) -> None:
    await page.get_by_role("button", name="Calibrate", exact=True).click()


async def press_arrows(page: Page, x: int, y: int) -> None:
    """Move the cross, ten pixels at a time first."""
    for moved, (back, ahead) in ((x, ("ArrowLeft", "ArrowRight")), (y, ("ArrowUp", "ArrowDown"))):
        key = ahead if moved > 0 else back
        for pressed in [f"Shift+{key}"] * (abs(moved) // 10) + [key] * (abs(moved) % 10):
            await page.keyboard.press(pressed)


async def mark_first_camera(page: Page) -> None:
    """Mark all places in the first camera, and enter their positions."""
    for number, (x, y) in enumerate(PLACES, 1):
        await press(page, 0, (x, y))
        await enter(page, number, f"{x:g}".replace(".", ","), f"{y:g}")


async def test_two_cameras_of_the_room_get_its_homographies_and_the_configuration_names_them(
    browser: Browser, path: Path, tmp_path: Path
) -> None:
    async with room_page(browser, path) as page:
        state = page.locator("#points-state")
        await calibrate(page)
        await expect(state).to_have_text("Mark places on the floor first, at least four in a picture.")
        await mark_first_camera(page)
        await page.locator("#points-camera").select_option(B)
        await expect(page.locator("#points-count")).to_contain_text("c1: 0 of at least 4 places")
        await page.get_by_label("Place to press").select_option("0")
        for place in PLACES[:3]:  # the next one is chosen by itself
            await press(page, 1, place)
        await calibrate(page)
        await expect(state).to_have_text("Calibration failed: camera c1: 3 pairs; at least 4 are needed")
        await page.reload()  # in the middle
        await expect(page.locator("#points-places li")).to_have_count(6)
        await page.locator("#points-camera").select_option(B)
        await page.get_by_label("Place to press").select_option("3")
        for place in PLACES[3:]:
            await press(page, 1, place)
        await expect(page.locator("#points-count")).to_be_empty()
        await expect(page.get_by_label("Place to press")).to_have_value("")
        await enter(page, 2, "17", "3")
        await calibrate(page)
        await expect(state).to_contain_text("camera c0: place 2 (image ")
        await expect(page.locator("#points-places li.wrong .place-number")).to_have_text("2")
        await expect(page.locator("#points-drawing .wrong")).to_have_count(1)
        await enter(page, 2, "7", "3")
        await calibrate(page)
        await expect(page.locator("#points-lines li")).to_have_text(
            [re.compile(rf"c{at}: 6 pairs, off by .* the worst is place \d") for at in (0, 1)]
        )
        await expect(page.locator("#points-places li").first).to_contain_text(
            re.compile(r"c0 at .*, off by 0.0\d+ m, \d.\d pixels · c1 at .*, off by 0.0\d+ m, \d.\d pixels")
        )
        plan = await page.locator("#points-plan").element_handle()
        await page.wait_for_function("(it) => it.naturalWidth > 0", arg=plan)
        section = page.locator("#calibration-points")
        for role, name in (("link", "Download the ground file"), ("button", "Download the points")):
            async with page.expect_download() as download:
                await section.get_by_role(role, name=name).click()
            await (await download.value).save_as(tmp_path / (await download.value).suggested_filename)
        assert [camera.camera for camera in read_points(tmp_path / "points.json").cameras] == [A, B]
        assert path.read_text() == TEXT
        await page.get_by_role("button", name="Write into the configuration").click()
        await expect(state).to_contain_text("Written into the configuration")
        assert (tmp_path / "site.ground.json").read_text() == (tmp_path / "ground.json").read_text()
        for at, camera in enumerate(load_config(path).cameras):
            assert error_of(camera.ground, at) < 0.1  # meters


async def test_what_others_changed_meanwhile_is_not_overwritten(browser: Browser, path: Path) -> None:
    apply_points(path, {"unit": "m", "cameras": {A: pairs(0), B: pairs(1)}}, "")
    ground = path.parent / "site.ground.json"
    async with room_page(browser, path) as page:
        state = page.locator("#points-state")
        await expect(page.get_by_label("Place 5, x on the floor")).to_have_value("5.5")
        await page.get_by_role("button", name="Remove place 1").click()
        await calibrate(page)
        await expect(page.locator("#points-lines li")).to_have_count(2)
        written = json.dumps({**json.loads(ground.read_text()), "points": {}})
        ground.write_text(written)
        await page.get_by_role("button", name="Write into the configuration").click()
        await expect(state).to_have_text(
            "the calibration in the configuration was changed meanwhile: calibrate again"
        )
        assert ground.read_text() == written
        path.write_text(path.read_text().replace(", {id: c1, source: 'scene:room'}", ""))
        await calibrate(page)
        await expect(state).to_contain_text(
            "the configuration has no camera 'c1' (any more): remove its points"
        )
        await page.locator("#points-camera").select_option(B)
        await page.locator("#points-clear").click()
        await calibrate(page)
        await expect(page.locator("#points-lines li")).to_have_count(1)
        await page.get_by_role("button", name="Write into the configuration").click()
        await expect(state).to_contain_text("Written into the configuration")
        assert ground.read_text() != written


async def test_another_camera_is_calibrated_by_keyboard_from_one_that_is(
    browser: Browser, path: Path
) -> None:
    axe = AXE.read_text(encoding="utf-8") if AXE.exists() else ""
    apply_points(path, {"unit": "m", "cameras": {A: pairs(0)}}, "")
    ground = json.loads((path.parent / "site.ground.json").read_text())
    (path.parent / "site.ground.json").write_text(json.dumps({**ground, "points": None}))
    async with room_page(browser, path, axe) as page:
        stage, following = page.locator("#points-stage"), page.get_by_label("Place to press")
        x, y = WIDTH // 2, HEIGHT // 2  # where the cross is
        for camera in (0, 1):
            await page.locator("#points-camera").select_option(f"c{camera}")
            if camera:
                await following.select_option("0")
            await stage.focus()
            for place in PLACES[:5]:
                to_x, to_y = (round(value) for value in image_of(camera, place)[0].tolist())
                await press_arrows(page, to_x - x, to_y - y)
                x, y = to_x, to_y
                await page.keyboard.press("Enter")
        await stage.focus()
        await page.keyboard.press("Backspace")
        await expect(page.locator("#points-drawing .point")).to_have_count(4)
        await expect(page.locator("#points-places li")).to_have_count(5)
        for number in range(1, 6):
            await page.get_by_role(
                "button", name=re.compile(f"Place {number}: .* as c0 is calibrated")
            ).focus()
            await page.keyboard.press("Enter")
        await expect(page.get_by_label("Place 5, x on the floor")).to_be_focused()
        await page.keyboard.press("Enter")
        await expect(page.locator("#points-lines li")).to_have_text(
            [re.compile("c0: 5 pairs"), re.compile("c1: 4 pairs always fit exactly")]
        )
        for width in (360, 800, 1600):
            await page.set_viewport_size({"width": width, "height": 800})
            assert await page.evaluate("document.documentElement.scrollWidth") <= width
            if width == 360:
                await check_button_sizes(page)
            if axe:
                assert await serious_faults(page) == []
        await page.get_by_role("button", name="Write into the configuration").focus()
        await page.keyboard.press("Enter")
        await expect(page.locator("#points-state")).to_contain_text("Written into the configuration")
        assert error_of(load_config(path).camera(B).ground, 1) < 0.5  # meters: marked to whole pixels


async def test_what_is_no_number_is_refused_at_its_field_and_many_places_are_shown(
    browser: Browser, path: Path
) -> None:
    async with open_operator_page(browser, "#calibration-points", control=SiteControl(path)) as (
        served,
        page,
    ):
        message = page.locator("#points-message")
        await expect(message).to_have_text("There is no picture of c0 now.")
        show_people(served)
        await page.locator("#points-picture").click()
        await expect(message).to_be_empty()
        state, stage = page.locator("#points-state"), page.locator("#points-stage")
        await stage.click(position={"x": 3, "y": 3})
        field = page.get_by_label("Place 1, x on the floor")
        for text, message in (
            ("", "Enter where the place is on the floor."),
            ("NaN", "Enter a number, such as 2.5."),
            ("1e400", "Enter a number, such as 2.5."),
            ("-2e9", "This is too far away."),
        ):
            await field.fill(text)
            await calibrate(page)
            assert await field.evaluate("(it) => it.validationMessage") == message
            await expect(field).to_be_focused()
        await expect(state).to_be_empty()
        await page.get_by_label("The floor is measured in").fill("metres")
        await enter(page, 1, "1", "1")
        await calibrate(page)
        await expect(state).to_contain_text("unit: 'metres' is not understood; did you mean 'm'?")
        random = np.random.default_rng(1)
        places = [
            {"position": [f"{x / 10:.3f}", f"{y / 10:.3f}"], "seen": [["c0", [x, y]], ["gone", [1, 1]]]}
            for x, y in random.uniform((0, 0), (64, 48), (500, 2)).tolist()
        ]
        saved = json.dumps({"unit": "m", "places": places})
        await page.evaluate("(saved) => sessionStorage.setItem('myview-points:hall', saved)", saved)
        await page.reload()
        await expect(page.locator("#points-drawing .point")).to_have_count(500)
        await calibrate(page)
        await expect(page.locator("#points-lines li")).to_contain_text("c0: 500 pairs, off by 0")
        await page.locator("#points-revert").click()
        await expect(page.locator("#points-places li")).to_have_count(0)
        await page.reload()
        await expect(page.locator("#points-places li")).to_have_count(0)
