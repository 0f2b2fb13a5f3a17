"""The site's own counters: received, missed and shed frames, and late windows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import aiohttp
from prometheus_client.parser import text_string_to_metric_families

_COUNTED = ("frames", "missed", "shed", "bad_messages")


@dataclass(frozen=True, slots=True)
class FrameCounts:
    """Counters of the best-view service.

    Attributes:
        cameras: by camera, then by counter.
        late: windows whose tracks arrived after the decision, of all cameras.
    """

    cameras: Mapping[str, Mapping[str, int]]
    late: int

    def since(self, earlier: FrameCounts) -> FrameCounts:
        """Return the difference to earlier counts."""
        cameras = {
            camera: {
                what: number - earlier.cameras.get(camera, {}).get(what, 0)
                for what, number in counts_of_camera.items()
            }
            for camera, counts_of_camera in self.cameras.items()
        }
        return FrameCounts(cameras, self.late - earlier.late)

    @property
    def dropped(self) -> int:
        """Frames that were missed or not searched, of all cameras."""
        return sum(camera["missed"] + camera["shed"] for camera in self.cameras.values())


def counts_in(metrics: str, late: int) -> FrameCounts:
    """Parse the text of `/metrics`."""
    cameras: dict[str, dict[str, int]] = {}
    for family in text_string_to_metric_families(metrics):
        for sample in family.samples:
            what = family.name.removeprefix("myview_camera_")
            if what in _COUNTED and "camera" in sample.labels and sample.name.endswith("_total"):
                cameras.setdefault(sample.labels["camera"], dict.fromkeys(_COUNTED, 0))[what] = int(
                    sample.value
                )
    return FrameCounts(dict(sorted(cameras.items())), late)


async def read_counts(url: str) -> FrameCounts:
    """Read the counters of a running site."""
    async with aiohttp.ClientSession() as session:
        async with session.get(f"{url}metrics") as answer:
            metrics = await answer.text()
        # The metric of late windows leaves out cameras that are no longer waited for.
        async with session.get(f"{url}api/cameras") as answer:
            late = sum(camera["late"] for camera in (await answer.json())["cameras"])
    return counts_in(metrics, late)
