"""What is shown: every box on its own frame, every frame from the camera of the choice, little delay."""

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
GROUNDS_SEEN = f"""
    const grounds = {[list(ground) for ground in GROUNDS]};
    const small = new OffscreenCanvas({WIDTH}, {HEIGHT}).getContext('2d', {{ willReadFrequently: true }});
    window.seen = [];
    const look = () => {{
      requestAnimationFrame(look);
      small.drawImage(document.querySelector('#boxes'), 0, 0, {WIDTH}, {HEIGHT});
      const [red, green, blue] = small.getImageData(2, 2, 1, 1).data;
      const far = grounds.map(([r, g, b]) => Math.hypot(r - red, g - green, b - blue));
      seen.push([myview.camera, myview.site.cameras[far.indexOf(Math.min(...far))]]);
    }};
    requestAnimationFrame(look);
"""
BEHIND_AT_MOST = 5.0  # seconds: three are lived with before a jump, and the look-ahead and a GOP come on top
MISSED = 6  # seconds
BUSY = "setInterval(() => { const t = performance.now() + 25; while (performance.now() < t); }, 40)"


def middle(mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.float64] | None:
    """Return the middle (x, y) of what is set, or None: of its extent, but for stray pixels."""
    rows, columns = np.nonzero(mask)
    if len(rows) < 50:
        return None
    extent = [np.percentile(axis, [5, 95]).mean() for axis in (columns, rows)]
    return np.array(extent)


def off_by(screen: npt.NDArray[np.int16]) -> float | None:
    """Return the distance in picture pixels of the green box from the bright square, None without a box."""
    green = np.abs(screen - ACCENT).max(axis=2) < 30
    left, top = np.nonzero(green.any(axis=0))[0], np.nonzero(green.any(axis=1))[0]
    white = middle(screen.min(axis=2) > 235)
    if white is None or not len(left):
        return None
    scale = screen.shape[1] / WIDTH
    # The box's label is above the box and no wider, so the box ends at the right and at the bottom.
    box = np.array([left.max(), top.max()]) - (SQUARE / 2) * scale
    return float(np.abs(box - white).max() / scale)


@pytest.mark.parametrize("busy", [False, True], ids=["idle", "busy"])
async def test_every_box_is_on_the_very_frame_it_belongs_to(browser: Browser, *, busy: bool) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        if busy:
            await visit.get(BUSY)
        distances = [off_by(await visit.screenshot()) for _ in range(25)]
        boxed = [distance for distance in distances if distance is not None]
        assert len(boxed) >= 23
        assert max(boxed) < 3  # the pattern moves by 14 pixels from frame to frame


async def test_cuts_are_shown_at_the_pulses_where_the_choice_changes(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.until("myview.cuts.length >= 2")
        shown = await visit.get("myview.delays.map((it) => it.pulse)")
        for cut in await visit.get("myview.cuts"):
            before = max(it for it in shown if it < cut["pulse"])
            chosen = cut["pulse"] - cut["pulse"] % HOLD
            assert before < chosen <= cut["pulse"], "at the first frame that a busy browser painted"
            assert cut["to"] == CAMERAS[visit.server.site.camera(1, cut["pulse"])]
            assert cut["from"] == CAMERAS[visit.server.site.camera(1, before)]
        assert await visit.page.locator("#cameras [aria-current]").inner_text() in CAMERAS


@pytest.mark.parametrize("bursts", [False, True], ids=["frames", "GOPs"])
async def test_the_camera_that_is_named_is_the_one_shown_however_fast_people_are_switched(
    browser: Browser, *, bursts: bool
) -> None:
    async with visiting(browser, FakeSite(bursts=bursts)) as visit:
        await visit.playing(1)
        await visit.get(f"(() => {{ {GROUNDS_SEEN} }})()")
        for turn in range(16):
            await visit.page.keyboard.press("ArrowRight")
            await visit.playing(2 if turn % 2 == 0 else 1)
            shown = await visit.get("myview.pulse")
            await visit.until(f"myview.pulse > {shown + turn % 5}")
        seen = await visit.get("seen.slice(1)")
        # Where the word on a moment comes after its frame, no camera is named; never another one.
        named = [(said, painted) for said, painted in seen if said is not None]
        assert len(named) > 50
        assert [(said, painted) for said, painted in named if said != painted] == []


async def test_boxes_can_be_hidden_and_shown_again(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.page.get_by_role("button", name="Boxes").click()
        assert off_by(await visit.screenshot()) is None
        await visit.page.keyboard.press("b")
        assert off_by(await visit.screenshot()) is not None


@pytest.mark.parametrize("bursts", [False, True], ids=["frames", "GOPs"])
async def test_the_delay_is_measured_and_neither_less_than_the_look_ahead_nor_without_end(
    browser: Browser, *, bursts: bool
) -> None:
    async with visiting(browser, FakeSite(bursts=bursts)) as visit:
        await visit.playing(1)
        await visit.until(f"myview.delays.length > {4 * FPS}")
        delays = await visit.get(f"myview.delays.slice(-{FPS}).map((it) => it.delayMs / 1000)")
        # The server lets no frame go before; its clock is known to half of a question's way there and back.
        assert min(delays) > LOOKAHEAD / FPS / 2
        # How close it comes on an idle machine is told with a clock of its own, in units/pace.test.js.
        await visit.until(f"myview.delays.slice(-{FPS}).every((it) => it.delayMs < {1000 * BEHIND_AT_MOST})")


async def test_far_behind_it_jumps_back_to_live(browser: Browser) -> None:
    async with visiting(browser) as visit:
        await visit.playing(1)
        await visit.until(f"video.currentTime > video.buffered.start(0) + {MISSED} + 0.5")
        stopped = await visit.get("myview.pulse")
        before = await visit.get(f"(video.currentTime -= {MISSED}) && myview.delays.length")
        await visit.until(f"myview.pulse > {stopped}")
        shown = await visit.get(f"myview.delays.slice({before}).map((it) => it.pulse)")
        assert sum(pulse < stopped for pulse in shown) < FPS, "not played through in a hurry"
