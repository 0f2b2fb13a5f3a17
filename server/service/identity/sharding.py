"""Sharding: how the best-view services of one site divide its people, by number or by where they are.

A shard is a share of the people (`view.sharding` of the configuration); several services may have the same.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from server.config.sections import ShardingSettings
from server.config.site_config import Config
from server.messaging.messages import CameraTracks
from server.service.identity.service_area import Floats, ServiceArea

_RELEASED_AFTER_S = 2.0
"""Seconds after which somebody who is not in the area any more, and is in another one, leaves it."""


@dataclass(frozen=True, slots=True, eq=False)
class TracksOfPeople:
    """Whom a camera's tracks show at the end of an epoch.

    Attributes:
        message: with T tracks.
        numbers: T of them; None: not visible, or not confirmed.
    """

    message: CameraTracks
    numbers: Sequence[int | None]


@dataclass(frozen=True, slots=True)
class AreaSighting:
    """Where the service of another area has seen a person; of several that of the first area.

    Attributes:
        area: its index.
        frame: the last one in which they certainly were there.
        is_visible: whether the service sees them now.
    """

    area: int
    frame: int
    is_visible: bool


class Sharding(Protocol):
    """Divides a site's people into shards, and tells which of them this service decides for."""

    def own(self, numbers: Iterable[int], merged: Mapping[int, int]) -> list[int]:
        """Return the numbers that belong to the service, in the given order.

        `merged`: by number, that of the person into whom they were merged.
        """
        ...

    def others(self, numbers: Iterable[int], merged: Mapping[int, int]) -> list[int]:
        """Return the numbers of other services' people, of those known here or by what they say."""
        ...

    def shard_of(self, number: int) -> int:
        """Return the index of the shard that a number belongs to, as far as is known."""
        ...

    def is_visible_elsewhere(self, number: int) -> bool | None:
        """Return whether another service sees one of its people now; None: all see the same."""
        ...

    def is_reported(self, number: int) -> bool:
        """Return whether this service tells other systems about a person: of several that know them, one."""
        ...

    def update(self, seen: Iterable[TracksOfPeople], frame: int) -> None:
        """Take in where people are seen in an epoch that ends with a frame."""
        ...

    def renumber(self, numbers: Mapping[int, int]) -> None:
        """Replace people's numbers by others."""
        ...

    def keep_only(self, numbers: Collection[int]) -> None:
        """Forget everybody else."""
        ...


class ShardingByNumber:
    """Divides people by number, the same in all services, without communication."""

    def __init__(self, sharding: ShardingSettings) -> None:
        self._settings = sharding

    def own(self, numbers: Iterable[int], merged: Mapping[int, int]) -> list[int]:
        """Return the numbers of the shard.

        Besides its own these are people into whom one of them was merged, so that viewers of the old number
        need not change the service.
        """
        of, shard = self._settings.of, self._settings.shard
        kept_numbers = {new for old, new in merged.items() if old % of == shard}
        return [number for number in numbers if number % of == shard or number in kept_numbers]

    def others(self, numbers: Iterable[int], merged: Mapping[int, int]) -> list[int]:
        """Return the numbers of the other shards, in the given order."""
        every = list(numbers)
        own = set(self.own(every, merged))
        return [number for number in every if number not in own]

    def shard_of(self, number: int) -> int:
        """Return the shard of a number, whether or not it is in use."""
        return number % self._settings.of

    def is_visible_elsewhere(self, number: int) -> None:
        """Return None: all services have the same cameras."""

    def is_reported(self, number: int) -> bool:  # noqa: ARG002
        """Return true: only the first service reports."""
        return True

    def update(self, seen: Iterable[TracksOfPeople], frame: int) -> None:
        """Ignore where people are."""

    def renumber(self, numbers: Mapping[int, int]) -> None:
        """Ignore it: numbers stay in their shard."""

    def keep_only(self, numbers: Collection[int]) -> None:
        """Ignore it: nothing is known about single people."""


SINGLE_SHARD = ShardingByNumber(ShardingSettings())
"""A single service has all people."""


class ShardingByArea:
    """Divides people by area. Who is at a border is known to both services, under one number.

    Somebody is in the area where most of the cameras say they are (`ServiceArea.votes`), or half of them
    while no other service has them: each knows only some of the cameras. A service from which another one
    takes somebody over keeps them for a while, so that no stream ends before the next one begins. Whom both
    have lost sight of stays with the one that has seen them last.
    """

    def __init__(self, sharding: ShardingSettings, area: ServiceArea, fps: float) -> None:
        self._settings, self._area = sharding, area
        self._released_after = round(_RELEASED_AFTER_S * fps)
        self._seen: dict[int, int] = {}
        """By number, of the people in the area, the last frame in which they certainly were."""
        self._elsewhere: dict[int, AreaSighting] = {}
        """By number, people whom other services have."""

    @property
    def present(self) -> Mapping[int, int]:
        """The numbers of people in the area, and the frame in which each certainly was, the last time."""
        return self._seen

    def own(self, numbers: Iterable[int], merged: Mapping[int, int]) -> list[int]:
        """Return the numbers of people in the area."""
        kept = {merged.get(number, number) for number in self._seen}
        return [number for number in numbers if number in kept]

    def others(self, numbers: Iterable[int], merged: Mapping[int, int]) -> list[int]:  # noqa: ARG002
        """Return the numbers of people whom other services say they have, in order."""
        return sorted(number for number in self._elsewhere if number not in self._seen)

    def shard_of(self, number: int) -> int:
        """Return the area where somebody is; this one if nobody else says that they are there."""
        if number in self._seen or number not in self._elsewhere:
            return self._settings.shard
        return self._elsewhere[number].area

    def is_visible_elsewhere(self, number: int) -> bool:
        """Return whether another area's service says that it sees somebody now."""
        other = self._elsewhere.get(number)
        return other is not None and other.is_visible

    def is_reported(self, number: int) -> bool:
        """Return whether nobody else has a person, or of all their areas this is the first."""
        other = self._elsewhere.get(number)
        return other is None or (number in self._seen and self._settings.shard < other.area)

    def update(self, seen: Iterable[TracksOfPeople], frame: int) -> None:
        """Take over who is in the area, and release who is in another one."""
        votes: dict[int, list[bool]] = {}
        for of_camera in seen:
            for number, vote in zip(of_camera.numbers, self._area.votes(of_camera.message), strict=True):
                if number is not None:
                    votes.setdefault(number, []).append(vote)
        for number, found in votes.items():
            here, there = sum(found), len(found) - sum(found)
            if here > there or (here == there and number not in self._elsewhere):
                self._seen[number] = frame
        self._seen = {
            number: last for number, last in self._seen.items() if not self._is_released(number, last, frame)
        }

    def _is_released(self, number: int, last: int, frame: int) -> bool:
        other = self._elsewhere.get(number)
        if other is None or frame - last <= self._released_after:
            return False
        return (-other.frame, other.area) < (-last, self._settings.shard)

    def set_sightings(self, sightings: Mapping[int, AreaSighting]) -> None:
        """Replace what other services say about who is in their areas, by number."""
        self._elsewhere = dict(sightings)

    def renumber(self, numbers: Mapping[int, int]) -> None:
        """Replace people's numbers by others."""
        self._seen = {numbers.get(number, number): last for number, last in self._seen.items()}

    def keep_only(self, numbers: Collection[int]) -> None:
        """Forget everybody else."""
        self._seen = {number: last for number, last in self._seen.items() if number in numbers}


def create_sharding(config: Config, homographies: Mapping[str, Floats | None]) -> Sharding:
    """Return how a site's services divide its people; `homographies` by camera, from its own picture."""
    sharding = config.view.sharding
    if not sharding.areas:
        return ShardingByNumber(sharding)
    return ShardingByArea(sharding, ServiceArea(sharding, homographies, config.site.size), config.site.fps)


def replacement_addresses(sharding: ShardingSettings) -> list[str]:
    """Return the addresses of the other services of this shard."""
    return [
        server.rstrip("/") + "/"
        for index, server in enumerate(sharding.servers)
        if index != sharding.index and sharding.shard_of_service(index) == sharding.shard
    ]


def shard_address(shard: int, sharding: ShardingSettings) -> str | None:
    """Return the address of the first service of a shard; None where the configuration has none."""
    return sharding.servers[shard].rstrip("/") + "/" if sharding.servers else None
