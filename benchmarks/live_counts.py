"""What the site says of itself on `/metrics`: frames that came, were missed, or were not searched."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import aiohttp
from prometheus_client.parser import text_string_to_metric_families

_COUNTED = ("frames", "missed", "shed", "bad_messages")
LATE = "late windows"


@dataclass(frozen=True, slots=True)
class Counts:
    """Counters of the best-view service.

    Attributes:
        cameras: by camera, then by what is counted.
        late: windows decided without a camera that was there.
    """

    cameras: Mapping[str, Mapping[str, int]]
    late: int

    def since(self, earlier: Counts) -> Counts:
        """Give what was counted since an earlier moment."""
        cameras = {
            camera: {
                what: number - earlier.cameras.get(camera, {}).get(what, 0) for what, number in it.items()
            }
            for camera, it in self.cameras.items()
        }
        return Counts(cameras, self.late - earlier.late)

    @property
    def dropped(self) -> int:
        """Frames that were missed or not searched, all cameras together."""
        return sum(it["missed"] + it["shed"] for it in self.cameras.values())


def counts_in(text: str) -> Counts:
    """Read the text of `/metrics`."""
    cameras: dict[str, dict[str, int]] = {}
    late = 0
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            what = family.name.removeprefix("myview_camera_")
            if what in _COUNTED and "camera" in sample.labels and sample.name.endswith("_total"):
                cameras.setdefault(sample.labels["camera"], dict.fromkeys(_COUNTED, 0))[what] = int(
                    sample.value
                )
            elif family.name == "myview_late_epochs" and sample.name.endswith("_total"):
                late = int(sample.value)
    return Counts(dict(sorted(cameras.items())), late)


async def read_counts(url: str) -> Counts:
    """Ask a running site."""
    async with aiohttp.ClientSession() as session, session.get(f"{url}metrics") as answer:
        return counts_in(await answer.text())
