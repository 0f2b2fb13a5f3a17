"""Frame rate, picture sizes and switch cost for scoring views, from options, videos or `site.json`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from server.cli.generated_config import camera_name
from server.cli.render.site_file import SITE_FILE, RenderedSite, read_site
from server.cli.render.video_info import Size, parse_size, read_video_info
from server.config.sections import ViewSettings
from server.system.errors import UserError


@dataclass(frozen=True, slots=True)
class SiteOptions:
    """Options that describe the site; None: not given."""

    size: str | None = None
    """WIDTHxHEIGHT of every camera's picture."""
    fps: float | None = None
    switch_cost_s: float | None = None


def videos_by_camera(videos: Sequence[Path], cameras: Sequence[str]) -> dict[str, Path]:
    """Return each camera's video, by name if the names are those of the cameras, otherwise in order.

    Raises:
        UserError: a camera has no video.
    """
    named = {camera_name(path): path for path in videos}
    if all(camera in named for camera in cameras):
        return {camera: named[camera] for camera in cameras}
    if len(videos) != len(cameras) or set(named) & set(cameras):
        raise UserError(
            f"--videos: give one for each of the cameras {', '.join(cameras)}, named like them or in "
            "this order"
        )
    return dict(zip(cameras, videos, strict=True))


def collect_site_info(
    choices: Path, cameras: Sequence[str], videos: Mapping[str, Path], options: SiteOptions
) -> RenderedSite:
    """Collect the site's properties from options, then videos, then `site.json` beside the choices.

    The rate of `site.json` takes precedence over that of videos: frames of choices are counted at it.

    Raises:
        UserError: the rate or a size is unknown or invalid.
    """
    beside = choices.with_name(SITE_FILE)
    rendering = read_site(beside) if beside.exists() else None
    sizes: dict[str, Size] = dict(rendering.sizes) if rendering else {}
    fps = rendering.fps if rendering else None
    for camera, path in videos.items():
        info = read_video_info(path)
        sizes[camera], fps = info.size, fps or info.fps
    if options.size is not None:
        sizes = dict.fromkeys(cameras, parse_size(options.size))
    fps = options.fps or fps
    without = [camera for camera in cameras if camera not in sizes]
    if without or fps is None:
        missing = f"the size of camera {without[0]}'s picture" if without else "the number of frames a second"
        raise UserError(
            f"--views: {missing} is not known (there is no {SITE_FILE} of a rendering beside {choices}, "
            "or it does not have it): give --size WIDTHxHEIGHT and --fps, or --videos"
        )
    if options.switch_cost_s is not None:
        switch_cost_s = options.switch_cost_s
    else:
        switch_cost_s = rendering.switch_cost_s if rendering else ViewSettings().switch_cost_s
    return RenderedSite(fps, switch_cost_s, {camera: sizes[camera] for camera in cameras})
