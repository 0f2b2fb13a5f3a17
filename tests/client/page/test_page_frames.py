"""Displayed frames: boxes match their frame, frames come from the selected camera, the delay is small."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from playwright.async_api import Browser

from fakes.page.browser import visiting
from fakes.page.site import HOLD, LOOKAHEAD, FakeSite
from fakes.page.video_pattern import CAMERAS, FPS, GROUNDS, HEIGHT, SQUARE, WIDTH
from fakes.programs import needs_chromium

pytestmark = [needs_chromium, pytest.mark.asyncio(loop_scope="session")]

ACCENT = np.array([0x3F, 0xDC, 0x7F], np.int16)
RECORD_CAMERAS = f"""
    const grounds = {[list(ground) for ground in GROUNDS]};
    const small = new OffscreenCanvas({WIDTH}, {HEIGHT}).getContext('2d', {{ willReadFrequently: true }});
    window.cameras = [];
    const record = () => {{
      requestAnimationFrame(record);
      small.clearRect(0, 0, {WIDTH}, {HEIGHT});
      small.drawImage(document.querySelector('#boxes'), 0, 0, {WIDTH}, {HEIGHT});
      const [red, green, blue, opaque] = small.getImageData(2, 2, 1, 1).data;
      if (!opaque) return; // the page did not paint the frame: the video behind the canvas may be ahead
      const distances = grounds.map(([r, g, b]) => Math.hypot(r - red, g - green, b - blue));
      cameras.push([myview.camera, myview.site.cameras[distances.indexOf(Math.min(...distances))]]);
    }};
    requestAnimationFrame(record);
"""
MAX_DELAY_S = 5.0  # three before a jump, plus the look-ahead and a GOP
MISSED_S = 6
BUSY = "setInterval(() => { const t = performance.now() + 25; while (performance.now() < t); }, 40)"


def middle(mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.float64] | None:
    """Return the center (x, y) of the extent of the set pixels without outliers; None: too few are set."""
    rows, columns = np.nonzero(mask)
    if len(rows) < 50:
        return None
    extent = [np.percentile(axis, [5, 95]).mean() for axis in (columns, rows)]
    return np.array(extent)


def box_offset(screen: npt.NDArray[np.int16]) -> float | None:
    """Return the distance of the green box from the bright square, pixels of the picture; None: no box."""
    green = np.abs(screen - ACCENT).max(axis=2) < 30
    left, top = np.nonzero(green.any(axis=0))[0], np.nonzero(green.any(axis=1))[0]
    white = middle(screen.min(axis=2) > 235)
    if white is None or not len(left):
        return None
    scale = screen.shape[1] / WIDTH
    # The label is above the box and no wider: the right and bottom edges are the box's.
    box = np.array([left.max(), top.max()]) - (SQUARE / 2) * scale
    return float(np.abs(box - white).max() / scale)


@pytest.mark.parametrize("busy", [False, True], ids=["idle", "busy"])
async def test_every_box_is_drawn_on_its_own_frame(browser: Browser, *, busy: bool) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        if busy:
            await visit.get(BUSY)
        distances = [box_offset(await visit.screenshot()) for _ in range(25)]
        boxed = [distance for distance in distances if distance is not None]
        assert len(boxed) >= 23
        assert max(boxed) < 3  # the pattern moves by 14 pixels from frame to frame


async def test_cuts_are_displayed_at_the_pulses_where_the_selected_camera_changes(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.until("myview.cuts.length >= 2")
        shown = await visit.get("myview.delays.map((delay) => delay.pulse)")
        for cut in await visit.get("myview.cuts"):
            before = max(pulse for pulse in shown if pulse < cut["pulse"])
            due = cut["pulse"] - cut["pulse"] % HOLD
            assert before < due <= cut["pulse"], "at the first frame after it that a busy browser painted"
            assert cut["to"] == CAMERAS[visit.server.site.camera(1, cut["pulse"])]
            assert cut["from"] == CAMERAS[visit.server.site.camera(1, before)]
        assert await visit.page.locator("#cameras [aria-current]").inner_text() in CAMERAS


@pytest.mark.parametrize("bursts", [False, True], ids=["frames", "GOPs"])
async def test_the_named_camera_is_the_displayed_one_during_fast_switches(
    browser: Browser, *, bursts: bool
) -> None:
    async with visiting(browser, FakeSite(bursts=bursts)) as visit:
        await visit.playing(1)
        await visit.get(f"(() => {{ {RECORD_CAMERAS} }})()")
        for turn in range(16):
            await visit.page.keyboard.press("ArrowRight")
            await visit.playing(2 if turn % 2 == 0 else 1)
            shown = await visit.get("myview.pulse")
            await visit.until(f"myview.pulse > {shown + turn % 5}")
        recorded = await visit.get("cameras.slice(1)")
        # While the decision for a frame has not arrived, no camera is named; never a wrong one.
        named = [(name, painted) for name, painted in recorded if name is not None]
        assert len(named) > 50
        assert [(name, painted) for name, painted in named if name != painted] == []


async def test_boxes_can_be_hidden_and_shown_again(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.page.get_by_role("button", name="Boxes").click()
        assert box_offset(await visit.screenshot()) is None
        await visit.page.keyboard.press("b")
        assert box_offset(await visit.screenshot()) is not None


@pytest.mark.parametrize("bursts", [False, True], ids=["frames", "GOPs"])
async def test_the_measured_delay_is_at_least_the_look_ahead_and_bounded(
    browser: Browser, *, bursts: bool
) -> None:
    async with visiting(browser, FakeSite(bursts=bursts)) as visit:
        await visit.playing(1)
        await visit.until(f"myview.delays.length > {4 * FPS}")
        delays = await visit.get(f"myview.delays.slice(-{FPS}).map((delay) => delay.delayMs / 1000)")
        # The server sends no frame earlier; its clock is known to half a round trip.
        assert min(delays) > LOOKAHEAD / FPS / 2
        # units/latency_control.test.js checks the delay of an idle machine with a simulated clock.
        await visit.until(
            f"myview.delays.slice(-{FPS}).every((delay) => delay.delayMs < {1000 * MAX_DELAY_S})"
        )


async def test_playback_far_behind_jumps_back_to_live(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.until(f"video.currentTime > video.buffered.start(0) + {MISSED_S} + 0.5")
        stopped = await visit.get("myview.pulse")
        before = await visit.get(f"(video.currentTime -= {MISSED_S}) && myview.delays.length")
        await visit.until(f"myview.pulse > {stopped}")
        shown = await visit.get(f"myview.delays.slice({before}).map((delay) => delay.pulse)")
        assert sum(pulse < stopped for pulse in shown) < FPS, "skipped, not played at a higher rate"
