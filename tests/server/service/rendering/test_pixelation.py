"""Pixelated people: their pixels carry no detail, and nothing else changes."""

from __future__ import annotations

import io

import av
import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.service.rendering import RENDER_SETTINGS, decoded_frames, fragments
from fakes.service.scripted_cameras import FPS, GOP, HEIGHT, WIDTH
from server.media.rendering_messages import WHOLE_PICTURE, Boxes, EncodedFrame, Region, RenderRequest
from server.service.rendering.decided_boxes import NO_OVERLAY, GopOverlay, hide_people
from server.service.rendering.worker.box_overlay import Image
from server.service.rendering.worker.pixelation import pixelate
from server.service.rendering.worker.stream_renderer import StreamRenderer

CELLS_MAX = 6 * 6
"""Colors in which a region is shown at most, however large."""
SIDE = 80

edges = st.floats(-20, SIDE + 20)
regions = st.builds(
    lambda x, y, width, height: (x, y, x + width, y + height),
    edges,
    edges,
    st.floats(1, 90),
    st.floats(1, 90),
)


def noise(seed: int) -> Image:
    return np.random.default_rng(seed).integers(0, 255, (SIDE, SIDE, 3), dtype=np.uint8)


def inside(region: Region, shape: tuple[int, ...]) -> np.ndarray:
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    left, top, right, bottom = region
    return (columns + 1 > left) & (columns < right) & (rows + 1 > top) & (rows < bottom)


@settings(max_examples=60)
@given(st.lists(regions, min_size=1, max_size=4), st.integers(0, 99))
def test_everything_in_a_region_is_a_few_flat_cells_and_all_else_is_unchanged(
    hidden: list[Region], seed: int
) -> None:
    image = noise(seed)
    shown = pixelate(image, hidden)
    covered = np.any([inside(region, image.shape) for region in hidden], axis=0)
    assert (shown[~covered] == image[~covered]).all()
    if covered.any():
        assert len(np.unique(shown[covered], axis=0)) <= CELLS_MAX * len(hidden)
        # Noise averaged over a cell of 8 by 8 pixels or more has an eighth of its spread, or less.
        assert shown[covered].std() < 0.5 * image[covered].std() + 1 or covered.sum() < 64


def test_a_face_is_one_color() -> None:
    image = noise(1)
    shown = pixelate(image, [(0.0, 0.0, 40.0, 80.0)])
    assert len(np.unique(shown[:13, :13].reshape(-1, 3), axis=0)) == 1


def rendered(
    renderer: StreamRenderer, data: bytes, first: int, hidden: list[list[Region]] | None
) -> list[Image]:
    request = RenderRequest(fragments=data, first=first, hidden=hidden, plain=[FPS])
    return [
        np.asarray(cv2.imdecode(np.frombuffer(picture.data, np.uint8), cv2.IMREAD_COLOR))
        for picture in renderer.render(request).plain
    ]


def is_blurred(image: Image, truth: Image) -> bool:
    """Return whether a part of the random pictures is not seen; each has squares of 8 pixels."""
    return bool(np.abs(image.astype(np.int16) - truth).mean() > 20)


HALF = HEIGHT // 2
UPPER: Region = (0.0, 0.0, WIDTH, HALF)


def test_regions_are_hidden_in_their_own_frames() -> None:
    hidden = [[UPPER] if pulse % 2 else [] for pulse in range(GOP)]
    shown = rendered(StreamRenderer(RENDER_SETTINGS), fragments(0, GOP), 0, hidden)
    for pulse, image in enumerate(shown):
        truth = decoded_frames(0)[pulse]
        assert is_blurred(image[:HALF], truth[:HALF]) == bool(pulse % 2)
        assert not is_blurred(image[HALF + 8 :], truth[HALF + 8 :])


def test_frames_of_which_nothing_is_known_are_hidden_wholly() -> None:
    renderer = StreamRenderer(RENDER_SETTINGS)
    shown = rendered(renderer, fragments(0, 2 * GOP), 0, [[]] * GOP)
    for pulse, image in enumerate(shown):
        assert is_blurred(image, decoded_frames(0)[pulse]) == (pulse >= GOP)
    assert all(
        is_blurred(image, decoded_frames(0)[2 * GOP + place])
        for place, image in enumerate(rendered(renderer, fragments(2 * GOP, GOP), 2 * GOP, []))
    )


def test_stills_and_video_are_hidden_too() -> None:
    renderer = StreamRenderer(RENDER_SETTINGS)
    result = renderer.render(RenderRequest(fragments=fragments(0, GOP), hidden=[], video="plain"))
    still = renderer.render(RenderRequest(still="boxed")).still
    assert still is not None
    image = np.asarray(cv2.imdecode(np.frombuffer(still.data, np.uint8), cv2.IMREAD_COLOR))
    truth = decoded_frames(0)
    assert is_blurred(image, truth[GOP - 1])
    films = decoded_video(result.video)
    assert len(films) == GOP
    assert all(is_blurred(shown, truth[pulse]) for pulse, shown in enumerate(films))


def decoded_video(frames: list[EncodedFrame]) -> list[Image]:
    with av.open(io.BytesIO(b"".join(frame.data for frame in frames)), "r", format="h264") as stream:
        return [frame.to_ndarray(format="bgr24") for frame in stream.decode(video=0)]


def overlay_of(numbers: list[int]) -> GopOverlay:
    frames: Boxes = [[(number, 1.0, 2.0, 3.0, 4.0) for number in numbers]]
    return hide_people(NO_OVERLAY, [*frames, None], 3, lambda number: 3 if number == 7 else number)


def test_everybody_but_the_person_is_hidden_by_any_of_their_numbers() -> None:
    assert overlay_of([3, 7, -1, 4]).hidden == [[(1.0, 2.0, 3.0, 4.0)] * 2, [WHOLE_PICTURE]]
    everybody = hide_people(NO_OVERLAY, [[(3, 1.0, 2.0, 3.0, 4.0)]], None, lambda number: number)
    assert everybody.hidden == [[(1.0, 2.0, 3.0, 4.0)]]
