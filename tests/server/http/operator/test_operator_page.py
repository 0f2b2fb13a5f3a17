"""The operator's page in a browser, on a served site: signing in, and every action."""

from __future__ import annotations

import asyncio
import json
import re
import time
from contextlib import closing
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
import yaml
from playwright.async_api import Browser, Page, Route, expect

from bestview import IdentityRegistry
from fakes.cli.calibration_walk import SITE, curved_path, errors_on_floor, walk_epochs
from fakes.http.tokens import token_entry, token_of, write_tokens
from fakes.media.rtsp_camera import RtspCamera
from fakes.page.operator_page import PLAN, check_button_sizes, open_operator_page, serious_faults
from fakes.paths import AXE
from fakes.programs import needs_chromium
from fakes.service.fed_site import A, B, show_people
from fakes.service.scripted_cameras import (
    CAMERAS,
    FPS,
    LARGE,
    SMALL,
    camera_tracks,
    encoded,
    lost_source,
    small_config,
    status,
    tracks,
    unavailable,
)
from fakes.setup.onvif_camera import FakeProfile, OnvifCamera, onvif_cameras
from fakes.timeouts import PATIENCE
from server.config.loader import load_config
from server.config.running_config import ConfigFileState
from server.http.app_keys import SiteControl
from server.messaging.messages import ZenohKeys
from server.messaging.operator_messages import RiskEvent
from server.setup.site_settings import StreamFormatChoice, save_choice

SECTIONS = ["cameras", "floor", "people", "flags", "downloads"]
SECTIONS += ["zones", "ignored-areas", "calibration", "calibration-points", "view-selection", "configuration"]


pytestmark = [
    needs_chromium,
    pytest.mark.asyncio(loop_scope="module"),
]


async def test_an_operator_signs_in_and_out_with_a_token(browser: Browser, tmp_path: Path) -> None:
    tokens = write_tokens(tmp_path / "tokens.yaml", token_entry("lead"), token_entry("desk"))
    async with open_operator_page(browser, access={"tokens": str(tokens)}) as (_, page):
        field = page.get_by_label("An operator's token")
        await field.fill("wrong")
        await page.get_by_role("button", name="Sign in").click()
        await expect(page.locator("#error-message")).to_have_text("unknown or revoked token")
        await page.keyboard.type(token_of("desk"))
        await page.keyboard.press("Enter")
        await expect(page.locator("#error-message")).to_have_text("the token 'desk' is only for watching")
        await field.fill(token_of("lead"))
        await page.keyboard.press("Enter")
        await expect(field).to_be_hidden()
        await expect(page.locator("#error-message")).to_be_empty()
        assert await page.evaluate("document.cookie") == ""
        await page.reload()
        await expect(page.locator("#cameras")).to_be_visible()
        await page.context.clear_cookies()  # as when the sign-in has run out
        await expect(field).to_be_visible()
        await expect(page.locator("#cameras")).to_be_hidden()
        await field.fill(token_of("lead"))
        await page.keyboard.press("Enter")
        await expect(page.locator("#cameras")).to_be_visible()
        await page.get_by_role("button", name="Sign out").click()
        await expect(field).to_be_visible()


async def test_a_site_without_tokens_shows_no_sign_in_form(browser: Browser) -> None:
    async with open_operator_page(browser) as (served, page):
        await expect(page.locator("#site")).to_have_text(served.service.config.site.name)
        await expect(page.get_by_label("An operator's token")).to_be_hidden()
        await expect(page.get_by_role("button", name="Sign out")).to_be_hidden()


async def test_every_camera_has_a_tile_with_its_state(browser: Browser) -> None:
    async with open_operator_page(browser, "#cameras") as (served, page):
        await expect(page.locator(".camera-tile .state")).to_have_text(["Starting", "Starting"])
        show_people(served)
        await expect(page.locator(".camera-tile .state")).to_have_text(["Live", "Live"])
        picture = await page.get_by_alt_text(f"What {A} sees now").element_handle()
        await page.wait_for_function("(it) => it.naturalWidth > 0", arg=picture)
        tile = page.locator(".camera-tile").first
        assert (
            await tile.locator("dt").all_text_contents()
            == await page.locator(".camera-tile >> nth=1 >> dt").all_text_contents()
        )
        served.service.ingest.receive_status(status(A, missed=3, clock_offset=-0.25))
        await expect(tile.get_by_text("-250 ms")).to_be_visible()
        served.service.ingest.set_present(ZenohKeys("hall").camera(A, "alive"), is_present=False)
        await expect(tile.locator(".state")).to_have_text("Gone")
        await expect(tile.locator(".last-error")).to_contain_text("its process disconnected")
        await expect(page.locator("#pulses")).to_contain_text("there is no pulse server at")


async def log_in(page: Page, user: str, password: str) -> None:
    """Enter the login of cameras."""
    await page.get_by_label("Their user").fill(user)
    await page.get_by_label("and password").fill(password)


async def test_cameras_are_added_renamed_and_removed_in_the_configuration(
    browser: Browser, tmp_path: Path
) -> None:
    path = tmp_path / "site.yaml"
    before = "cameras: [{id: c0, source: 'scene:room'}]\n"
    path.write_text(before)

    def on_disk() -> ConfigFileState:
        return ConfigFileState("", ("cameras",) if path.read_text() != before else ())

    gops = [encoded(0, 40)[at : at + 5] for at in range(0, 40, 5)]
    control = SiteControl(path, asyncio.Event())
    with closing(RtspCamera(gops, FPS, login=("viewer", "s3cret"), live=True)) as stream:
        async with open_operator_page(
            browser, "#cameras", patience=PATIENCE, on_disk=on_disk, control=control
        ) as (_, page):
            names = page.get_by_label(re.compile("^Name of camera"))
            trials = page.get_by_role("list", name="Trials of addresses")
            await expect(names).to_have_count(1)
            await page.get_by_label("Or an address").fill(stream.url)
            await page.get_by_label("and its substream").fill(f"{stream.url}/small")
            await log_in(page, "viewer", "wrong")
            await page.get_by_label("Its name").fill("door")
            await page.get_by_role("button", name="Try", exact=True).click()
            await expect(trials).to_contain_text("401")
            await expect(page.locator("#restart")).to_be_hidden()
            await log_in(page, "viewer", "s3cret")
            await page.get_by_role("button", name="Try", exact=True).click()
            await expect(names).to_have_count(2)
            await expect(trials).to_contain_text("sends pictures and was added")
            await expect(page.locator("#site-cameras li").last).to_contain_text("people tracked in rtsp://")
            await expect(page.locator("#restart-state")).to_contain_text("not in force: cameras.")
            await page.get_by_label("Name of camera door").fill("c0")
            await page.get_by_role("button", name="Rename camera door").click()
            await expect(page.locator("#error-message")).to_have_text("another camera is called c0")
            await page.get_by_label("Name of camera door").fill("hall")
            await page.get_by_role("button", name="Rename camera door").click()
            await expect(page.get_by_label("Name of camera hall")).to_have_value("hall")
            assert load_config(path).camera_ids == ("c0", "hall")
            await page.get_by_label("or as the address of").select_option("c0")
            await expect(page.get_by_label("Its name")).to_be_disabled()
            await page.get_by_label("Or an address").fill(stream.url)
            await page.get_by_role("button", name="Try", exact=True).click()
            await expect(trials).to_contain_text("another camera of the configuration")
            await page.get_by_role("button", name="Remove camera hall").click()
            await expect(names).to_have_count(1)
            await page.get_by_role("button", name="Try", exact=True).click()
            await expect(trials).to_contain_text("and is the address of c0 now")
            await expect(page.get_by_label("Its name")).to_be_enabled()
            config = load_config(path)
            assert (config.camera_ids, config.camera("c0").password) == (
                ("c0",),
                path.parent / "site.passwords/c0",
            )
            await page.get_by_label("Frames a second").fill("12.5")
            await page.get_by_label("Name of the site").fill("shop")
            await page.get_by_role("button", name="Change the site").click()
            await expect(page.locator("#site-state")).to_have_text("Saved; the earlier file is kept.")
            assert load_config(path).site.model_dump(include={"name", "fps"}) == {"name": "shop", "fps": 12.5}
            await expect(page.locator("#restart-state")).to_contain_text("Streams end for some seconds")


async def test_a_camera_of_the_network_is_found_and_added_with_its_small_stream(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("onvif", reason="needs onvif-zeep-async: the extra onvif")
    path = tmp_path / "site.yaml"
    path.write_text("cameras: [{id: c0, source: 'scene:room'}]\n")
    gops = [encoded(0, 40)[at : at + 5] for at in range(0, 40, 5)]
    with closing(RtspCamera(gops, FPS, login=("viewer", "s3cret"), live=True)) as stream:
        profiles = [
            FakeProfile(name, f"{stream.url}/{name}", width, 360, 25)
            for name, width in (("main_stream_of_the_camera_in_high_quality", 1280), ("sub", 640))
        ]
        with onvif_cameras(OnvifCamera("door", profiles, ("viewer", "s3cret"))) as targets:
            monkeypatch.setenv("MYVIEW_DISCOVERY", targets)
            async with open_operator_page(
                browser, "#cameras", patience=PATIENCE, control=SiteControl(path)
            ) as (_, page):
                await log_in(page, "viewer", "s3cret")
                await page.get_by_role("button", name="Search the network").click()
                await page.get_by_role("button", name=re.compile("Show its streams")).click()
                await expect(page.get_by_label("in which people are tracked")).to_contain_text("sub")
                await page.get_by_role("button", name=re.compile("Try main")).click()
                await expect(page.get_by_label("Name of camera door")).to_be_visible()
                for width in (360, 1600):
                    await page.set_viewport_size({"width": width, "height": 800})
                    assert await page.evaluate("document.documentElement.scrollWidth <= innerWidth")
                await page.get_by_role("link", name="Floor").click()
                await expect(page.get_by_label("and password")).to_have_value("")
    source, substream = (f"rtsp://viewer:{{password}}@{profile.address[7:]}" for profile in profiles)
    assert load_config(path).camera("door").model_dump(include={"source", "substream"}) == {
        "source": source,
        "substream": substream,
    }


async def test_settings_that_another_operator_has_changed_meanwhile_are_shown(
    browser: Browser, tmp_path: Path
) -> None:
    path = tmp_path / "site.yaml"
    path.write_text("cameras: [{id: c0, source: 'scene:room'}]\n")
    async with open_operator_page(browser, "#cameras", control=SiteControl(path)) as (_, page):
        name = page.get_by_label("Name of the site")
        await expect(name).to_have_value("site")
        save_choice(path, StreamFormatChoice("mall", 12.5, 640, 360))
        await page.get_by_label("Width").fill("320")
        await page.get_by_role("button", name="Change the site").click()
        await expect(page.locator("#site-state")).to_have_text(
            "Somebody else has changed the site meanwhile: name mall, frames a second 12.5. "
            "What you entered is kept; press again to save it."
        )
        await expect(name).to_have_value("mall")
        await expect(page.get_by_label("Width")).to_have_value("320")
        assert load_config(path).site.size == (640, 360)
        await page.get_by_label("Width").fill("321")  # what is only invalid stays to be corrected
        await page.get_by_label("Width").evaluate("field => field.step = 1")
        await page.get_by_role("button", name="Change the site").click()
        await expect(page.locator("#site-state")).to_contain_text("must be even")
        await expect(page.get_by_label("Width")).to_have_value("321")


async def test_the_floor_plan_shows_cameras_and_people_at_their_positions(browser: Browser) -> None:
    cameras = [{"id": camera, "source": "scene:room", "ground": PLAN} for camera in CAMERAS]
    async with open_operator_page(browser, "#floor", cameras=cameras) as (served, page):
        await expect(page.locator("#floor-message")).to_have_text("No camera has reported yet.")
        show_people(served)
        await page.reload()
        await expect(page.locator("#plan polygon")).to_have_count(2)
        served.service.feed(3, {A: {1: SMALL, 2: SMALL}, B: {1: SMALL}})
        served.service.feed(4, {A: {2: SMALL}, B: {1: SMALL}})
        left, _, right, bottom = SMALL
        stands = f"{(left + right) / 20:.2f}, {bottom / 10:.2f}"
        await expect(page.locator("#positions li").nth(1)).to_have_text(f"2 at {stands}, seen by {A}")
        await expect(page.locator("#plan .dot")).to_have_count(2)
        assert await page.locator("#plan .track").nth(1).get_attribute("points") is not None


async def test_the_floor_plan_shows_zones_who_is_in_them_and_events(browser: Browser) -> None:
    cameras = [{"id": camera, "source": "scene:room", "ground": PLAN} for camera in CAMERAS]
    zones = [
        {"id": "hall", "area": [[0, 0], [99, 0], [99, 99], [0, 99]], "hold_s": 0},
        {"id": "door", "line": [[0, 0], [9, 0]], "inner": [5, 5]},
    ]
    rules = [{"id": "came-in", "kind": "entered", "zone": "hall"}]
    async with open_operator_page(browser, "#floor", cameras=cameras, zones=zones, rules=rules) as (
        served,
        page,
    ):
        await expect(page.locator("#zone-people li")).to_have_text(["hall: no one"])
        await expect(page.get_by_role("heading", name="Events")).to_be_hidden()
        show_people(served)
        await page.reload()
        await expect(page.locator("#plan polygon.zone")).to_have_count(1)
        await expect(page.locator("#plan polyline.zone")).to_have_count(1)
        await expect(page.locator("#zone-people li")).to_have_text(["hall: 1, 2"])
        await expect(page.locator("#rule-events li").first).to_contain_text("came-in: entered hall: ")


async def test_an_uncalibrated_site_shows_how_to_calibrate(browser: Browser) -> None:
    async with open_operator_page(browser, "#floor") as (served, page):
        show_people(served)
        await expect(page.locator("#floor-message")).to_contain_text("No camera is calibrated")
        await expect(page.locator("#plan")).to_be_hidden()


async def test_people_are_renamed_merged_and_split_on_both_pages(browser: Browser) -> None:
    async with open_operator_page(browser, "#people") as (served, page):
        people = served.service.decider.people
        people._registry = IdentityRegistry(served.service.config.view.identity, dict.fromkeys(CAMERAS))
        await expect(page.locator("#people-message")).to_have_text("No people yet.")
        show_people(served)
        first, second, *_ = people.known
        await page.get_by_label(f"Name of person {first}").fill("Ann")
        await page.keyboard.press("Enter")
        await expect(page.locator("#people-message")).to_have_text(f"{first} is called Ann.")
        await expect(page.locator("#merge-kept option").first).to_have_text(f"{first} Ann")
        await page.get_by_label("and merge into it").select_option(str(second))
        await page.get_by_role("button", name="Merge").click()
        await expect(page.locator("#people-message")).to_have_text(f"{second} is merged into {first}.")
        assert people.registry.merged == {second: first}
        served.service.feed(3, {A: {1: SMALL, 2: SMALL}, B: {1: LARGE}})
        await expect(page.locator(f'#people-list [data-object="{second}"]')).to_have_count(0)
        shown = people.number(A, 1, 15)
        await page.get_by_label("Split", exact=True).select_option(str(shown))
        await page.get_by_label("as seen by").select_option(A)
        await page.get_by_role("button", name="Split off as new person").click()
        await expect(page.locator("#people-message")).to_have_text(re.compile(r"Split off as person \d+\."))
        assert people.number(A, 1, 19) != shown
        await check_deletion(page, first)
        assert first not in people.known
        first = people.known[0]
        await page.get_by_label(f"Name of person {first}").fill("Ann")
        await page.keyboard.press("Enter")
        await expect(page.locator("#people-message")).to_have_text(f"{first} is called Ann.")
        await page.goto(f"http://127.0.0.1:{served.port}/?object={first}")
        await expect(page.locator("#people .number").first).to_have_text(f"{first} Ann")
        await expect(page).to_have_title(f"Person {first}, Ann · MyView")


async def check_deletion(page: Page, number: int) -> None:
    """Delete a person who is called Ann: first what would be deleted is shown, then it must be confirmed."""
    await page.get_by_label("Number", exact=True).fill("999")
    await page.get_by_role("button", name="What would be deleted").click()
    await expect(page.locator("#error-message")).to_have_text("there is no object 999")
    await page.get_by_label("Number", exact=True).fill(str(number))
    await page.get_by_role("button", name="What would be deleted").click()
    await expect(page.locator("#delete-plan li").first).to_contain_text("Ann: numbers ")
    await page.get_by_role("button", name="Cancel").click()
    await expect(page.locator("#delete-confirmation")).to_be_hidden()
    await page.get_by_role("button", name="What would be deleted").click()
    await page.get_by_role("button", name="Delete for good").click()
    await expect(page.locator("#delete-state")).to_be_empty()  # nothing is chosen
    await page.get_by_label("Keep recorded video and sound").check()
    await page.get_by_role("button", name="Delete for good").click()
    await expect(page.locator("#delete-state")).to_have_text(f"The data of person {number} are deleted.")
    await expect(page.locator("#delete-confirmation")).to_be_hidden()


async def test_a_tile_says_what_is_wrong_with_the_picture(browser: Browser) -> None:
    async with open_operator_page(browser, "#cameras") as (served, page):
        show_people(served)
        served.service.ingest.receive_status(status(A, condition="turned", condition_since=1.0))
        tile = page.locator(".camera-tile").first
        await expect(tile.locator(".state")).to_contain_text("Turned away since ")
        await expect(tile.locator(".last-error")).to_contain_text("the camera is turned away: ")
        served.service.ingest.receive_status(status(A, covered_share=0.35))
        await expect(tile.locator(".state")).to_have_text("35 % covered")
        await expect(tile).to_have_class("camera-tile unclear")
        await expect(tile.locator(".last-error")).to_contain_text("35 % of the picture is covered: ")
        served.service.ingest.receive_status(status(A))
        await expect(tile.locator(".state")).to_have_text("Live")


async def test_a_tile_says_that_a_camera_waits_why_and_until_when(browser: Browser) -> None:
    async with open_operator_page(browser, "#cameras") as (served, page):
        show_people(served)
        tile = page.locator(".camera-tile").first
        await expect(tile.locator(".state")).to_have_text("Live")
        served.service.ingest.set_present(ZenohKeys("hall").camera(A, "alive"), is_present=False)
        served.service.ingest.receive_unavailable(
            unavailable(A, "changed", 3600.0, "10.0.0.9: its images are small")
        )
        await expect(tile.locator(".state")).to_have_text("Waiting")
        line = r"Will be opened again at \d.*: 10\.0\.0\.9: its images are small"
        await expect(tile.locator(".last-error")).to_have_text(re.compile(line))
        served.service.ingest.receive_unavailable(
            unavailable(A, "changed", 0.0, "10.0.0.9: its images are small")
        )
        await expect(tile.locator(".last-error")).to_have_text("10.0.0.9: its images are small")
        await expect(tile.locator(".state")).to_have_text("Gone")
        served.service.connect_cameras(A)
        served.service.ingest.receive_status(status(A))
        await expect(tile.locator(".state")).to_have_text("Live")
        lost = lost_source("Connection refused", 3600.0)
        served.service.ingest.receive_status(status(A, state="away", unavailable=lost))
        await expect(tile.locator(".state")).to_have_text("Waiting")
        line = r"Will be opened again at \d.*: rtsp://10\.0\.0\.9/\.\.\.: Connection refused"
        await expect(tile.locator(".last-error")).to_have_text(re.compile(line))


async def test_flags_are_listed_with_their_state(browser: Browser) -> None:
    async with open_operator_page(browser, "#flags") as (served, page):
        await expect(page.locator("#no-flags")).to_have_text("None so far.")
        show_people(served)
        served.service.decider.people.registry.set_name(1, "Ann")
        trouble = RiskEvent(reason="crossing", tracks=[2, 1], pulse=29, margin=0.1, risk=0.5)
        served.service.ingest.receive_tracks(
            tracks(camera_tracks(A, 3, {1: SMALL, 2: SMALL}, risk_events=[trouble]))
        )
        served.service.ingest.receive_tracks(tracks(camera_tracks(B, 3, {1: LARGE})))
        served.service.pulses.newest = 19
        served.service.decide()
        line = page.locator("#flag-list li")
        await expect(line).to_have_text(re.compile(r"2 and 1.* cross .* \(c0\): open"))
        await expect(page.locator("#no-flags")).to_have_text("")
        served.service.assist.flags.step(29 + 8 * FPS + 1, [], int)
        await expect(line).to_have_text(re.compile(r": expired without an answer"))
        await page.reload()
        await expect(line).to_have_text(re.compile(r": expired without an answer"))
        # A restarted service has no flags; the page sees the end of its connection.
        served.service.assist.flags._ended.clear()
        [events] = [callback.__self__ for callback in served.service.assist.flags.on_flag]  # type: ignore[attr-defined]
        connections, events._by_scope = events._by_scope, {}
        for connection in connections.values():
            connection.channel.close()
        await expect(page.locator("#no-flags")).to_have_text("None so far.")


async def test_recorded_decisions_of_a_time_range_are_downloaded(browser: Browser) -> None:
    async with open_operator_page(browser, "#downloads") as (served, page):
        end = int(time.time())
        served.service.pulses.pulse0 = end - 0.2  # five frames before
        show_people(served)
        for label, moment in (("From", end - 60), ("to", end)):
            local = datetime.fromtimestamp(moment)  # noqa: DTZ006 — as the page shows it
            await page.get_by_label(label, exact=True).fill(local.isoformat())
        await expect(page.get_by_role("link", name="Person 1")).to_be_visible()
        async with page.expect_download() as download:
            await page.get_by_role("link", name="Tracks (CSV)").click()
        tracks = (await (await download.value).path()).read_text(encoding="utf-8").splitlines()
        assert len(tracks) == 1 + 3 * 5
        assert (await download.value).suggested_filename.startswith("hall-tracks-p0-")
        async with page.expect_download() as download:
            await page.get_by_role("link", name=A, exact=True).click()
        assert (await download.value).suggested_filename.endswith(".mp4")
        assert b"moof" in (await (await download.value).path()).read_bytes()
        await page.get_by_label("From").fill("2020-01-02T00:00:00")
        await page.get_by_label("to", exact=True).fill("2020-01-01T00:00:00")
        await expect(page.locator("#download-tables")).to_have_text("The end is not after the start.")


async def test_a_late_picture_of_another_camera_does_not_replace_the_selected_one(
    browser: Browser,
) -> None:
    async with open_operator_page(browser, "#configuration") as (
        served,
        page,
    ):  # without requesting a picture
        show_people(served)
        late = asyncio.Event()

        async def answer(route: Route) -> None:
            if f"/{A}/" in route.request.url:
                await late.wait()
            await route.continue_()

        await page.route("**/live.jpg", answer)
        async with page.expect_request(f"**/{A}/live.jpg"):
            await page.locator("#sections").get_by_role("link", name="Ignored areas").click()
        await page.locator("#mark-camera").select_option(B)
        image = page.locator("#mark-image")
        await expect(image).to_have_attribute("src", re.compile("^blob:"))
        shown = await image.get_attribute("src")
        async with page.expect_response(f"**/{A}/live.jpg") as response:
            late.set()
        await (await response.value).finished()
        await page.evaluate("new Promise((seen) => setTimeout(seen, 100))")
        assert await image.get_attribute("src") == shown


async def test_configured_areas_appear_even_if_buttons_are_pressed_before_they_load(
    browser: Browser,
) -> None:
    cameras = [A, {"id": B, "source": "scene:room", "ignore": [[[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]]]}]
    async with open_operator_page(browser, "#ignored-areas", cameras=cameras) as (served, page):
        show_people(served)
        pressed = asyncio.Event()

        async def answer(route: Route) -> None:
            await pressed.wait()
            await route.continue_()

        await page.route("**/api/operator/config", answer)
        await page.reload()
        await page.locator("#mark-camera").select_option(B)
        await page.get_by_role("button", name="Next area").click()
        pressed.set()
        await expect(page.get_by_label("Marks as YAML")).to_have_value(
            f"cameras:\n  - id: {B}\n    ignore: [[[0, 0], [9, 0], [9, 9]]]\n"
        )


async def test_ignored_areas_become_configuration_lines(browser: Browser) -> None:
    existing_areas = [[[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]]]
    cameras = [{"id": A, "source": "scene:room", "ignore": existing_areas}, B]
    async with open_operator_page(browser, "#ignored-areas", cameras=cameras) as (served, page):
        show_people(served)
        await page.reload()
        stage, lines = page.locator("#mark-stage"), page.get_by_label("Marks as YAML")
        await expect(page.locator("#mark-drawing .area")).to_have_count(
            2
        )  # the configured one and the one being drawn
        box = await stage.bounding_box()
        assert box is not None
        for x, y in ((0.25, 0.25), (0.75, 0.25)):
            await stage.click(position={"x": x * box["width"], "y": y * box["height"]})
        await page.keyboard.press("Shift+ArrowDown")
        await page.keyboard.press("ArrowLeft")
        await page.keyboard.press("Enter")
        await page.keyboard.press("Enter")
        await page.keyboard.press("Backspace")
        written = yaml.safe_load(await lines.input_value())["cameras"][0]
        site = served.service.config.site
        drawn_area = np.array(written["ignore"][1])
        right, top = 0.75 * site.width, 0.25 * site.height
        expected = [[0.25 * site.width, top], [right, top], [right - 1, top + 10]]
        np.testing.assert_allclose(drawn_area, expected, atol=0.2)
        assert written["ignore"][0] == existing_areas[0]
        small_config(cameras=[{**written, "source": "scene:room"}])
        await page.get_by_role("button", name="Clear").click()
        assert "ignore: []" in await lines.input_value()


async def test_a_calibration_walk_yields_the_scenes_homographies(browser: Browser, tmp_path: Path) -> None:
    async with open_operator_page(browser, "#calibration", patience=280, **SITE) as (served, page):
        walking, state = served.service.walk_session, page.locator("#walk-state")
        await expect(state).to_have_text("No walk yet.")
        await expect(page.get_by_role("button", name="Finish")).to_be_disabled()
        await page.get_by_role("button", name="Start the walk").click()
        await expect(state).to_have_text("Walk now. 0:00 minutes so far.")
        await expect(page.locator("#walk-uncovered li")).to_have_count(len(CAMERAS))
        for sample in walk_epochs(served.service.config, curved_path(500)):
            walking.add(sample)
        await expect(state).to_have_text("Walk now. 0:20 minutes so far.")
        await expect(page.locator("#walk-pairs li")).to_have_text(re.compile(rf"{A} and {B}: \d+ s"))
        await expect(page.locator("#walk-cameras tr")).to_have_text([re.compile(r"(\d+ %){3}")] * 2)
        await page.get_by_role("button", name="Finish").click()
        # Calibration runs in a process of lower priority.
        first = page.locator("#walk-lines li").first
        await expect(first).to_contain_text("feet that two cameras see are", timeout=200_000)
        plan = await page.locator("#walk-plan").element_handle()
        await page.wait_for_function("(it) => it.naturalWidth > 0", arg=plan)
        async with page.expect_download() as download:
            await page.get_by_role("link", name="Download the ground file").click()
        await (await download.value).save_as(tmp_path / "ground.json")
        lines = page.get_by_label("Configuration lines for the ground file")
        found = yaml.safe_load(await lines.input_value())
        assert found["ground"] == (await download.value).suggested_filename == "ground.json"
        await page.get_by_role("button", name="Discard").click()
        await expect(state).to_have_text("No walk yet.")
        await expect(page.locator("#walk-result")).to_be_hidden()
    matrices = json.loads((tmp_path / "ground.json").read_text())["homography"]
    assert np.median(errors_on_floor([np.array(matrices[camera]) for camera in CAMERAS])) < 0.15  # meters


async def test_trial_settings_apply_and_can_be_reset_to_the_file(browser: Browser) -> None:
    async with open_operator_page(browser, "#view-selection") as (served, page):
        decider, lines = served.service.decider, page.get_by_label("Lines for the configuration")
        cost = page.get_by_label("Cut cost λ, s")
        await expect(cost).to_have_value("0.04")
        await cost.fill("2")
        await page.get_by_label("Centering").fill("0.5")
        await page.keyboard.press("Enter")
        await expect(page.locator("#selection-state")).to_have_text("2 changed from the file.")
        assert (decider.view.switch_cost_s, decider.view.quality.centering) == (2.0, 0.5)
        assert "switch_cost_s: 2.0" in await lines.input_value()
        ahead = page.get_by_label("Look-ahead, s")
        await ahead.fill(str((served.service.max_lookahead + 1) / 25))
        await page.keyboard.press("Enter")
        assert await ahead.evaluate("(it) => it.validity.rangeOverflow")
        await ahead.fill("0.6")
        await page.keyboard.press("Enter")
        await expect(page.locator("#selection-state")).to_have_text("3 changed from the file.")
        assert decider.view.lookahead_s == 0.6
        await page.get_by_label("Size").fill("0")  # the page lets it pass, the site does not: all are 0
        for name in ("Truncation", "Occlusion", "Centering", "Clear picture"):
            await page.get_by_label(name).fill("0")
        await page.get_by_role("button", name="Apply").click()
        await expect(page.locator("#error-message")).to_contain_text("all weights are 0")
        await page.get_by_role("button", name="Revert to file").click()
        await expect(page.locator("#selection-state")).to_have_text("As in the file.")
        await expect(page.locator("#error-message")).to_be_empty()
        assert decider.view == served.service.config.view


async def test_the_configuration_shows_differences_and_can_be_searched(browser: Browser) -> None:
    async with open_operator_page(browser, "#configuration") as (_, page):
        rows = page.locator("#settings tr")
        await expect(rows.filter(has_text="encode.gop_s")).to_have_text("encode.gop_s0.20.4")
        await expect(rows.filter(has_text="http.jpeg_quality")).to_have_count(0)
        await page.get_by_role("button", name="Only non-defaults").click()
        await page.get_by_label("Find").fill("jpeg")
        await expect(rows).to_have_text(["http.jpeg_quality80"])
        await page.get_by_label("Find").fill("no such")
        await expect(page.get_by_text("No matching setting.")).to_be_visible()


async def test_no_width_overflows_and_axe_finds_no_serious_violation(browser: Browser) -> None:
    axe = AXE.read_text(encoding="utf-8") if AXE.exists() else ""
    async with open_operator_page(browser, axe=axe, patience=PATIENCE) as (served, page):
        show_people(served)
        for width in (360, 800, 1600):
            await page.set_viewport_size({"width": width, "height": 800})
            for section in SECTIONS:
                await page.evaluate("(it) => { location.hash = it; }", section)
                await expect(page.locator(f"#{section}")).to_be_visible()
                assert await page.evaluate("document.documentElement.scrollWidth") <= width, section
                if width == 360:
                    await check_button_sizes(page)
                if width == 800 and axe:
                    assert await serious_faults(page) == []
    if not axe:
        pytest.skip("axe-core is not there: make node_modules/.installed")


async def test_sections_are_reached_by_keyboard_and_stored_in_the_url(browser: Browser) -> None:
    async with open_operator_page(browser) as (_, page):
        await expect(page.locator("#cameras")).to_be_visible()
        for section in SECTIONS[1:]:
            await page.locator(f'nav a[href="#{section}"]').focus()
            await page.keyboard.press("Enter")
            await expect(page.locator(f"#{section}")).to_be_visible()
            await expect(page.locator("main > section:visible")).to_have_count(1)
            assert page.url.endswith(f"#{section}")
