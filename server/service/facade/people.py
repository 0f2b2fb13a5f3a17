"""People: their views and the reasons for them, and the operator's manual corrections."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import msgspec

from server.messaging.camera_identity_snapshot import NAME_LENGTH_MAX
from server.messaging.messages import GopChoices
from server.service.facade.errors import (
    ConflictError,
    InvalidCommandError,
    UnknownCameraError,
    UnknownObjectError,
)
from server.service.facade.view_selection import ViewSelection, view_selection_of
from server.service.identity.sharding import replacement_addresses, shard_address
from server.service.ingest.ingest import Thumbnail
from server.service.pipeline import BestViewPipeline
from server.service.view_selection.delay_modes import DelayMode

__all__ = [
    "MergePeople",
    "PeopleService",
    "PersonElsewhere",
    "PersonOverrides",
    "PersonSummary",
    "RenamePerson",
    "Shard",
    "SplitPerson",
    "Thumbnail",
]

_THUMBNAIL_RECENT_S = 3
"""Age in seconds up to which a thumbnail of the chosen camera is preferred to newer ones of other cameras."""


@dataclass(frozen=True, slots=True)
class PersonSummary:
    """One person who has a stream. Pulses are frame numbers of the site."""

    number: int
    name: str | None
    former_numbers: list[int]
    """Numbers that were merged into this one; they still work in URLs."""
    first_seen: int
    last_seen: int
    camera: str | None
    """The camera that shows the person now."""
    cameras: list[str]
    """The cameras that see the person now."""
    thumbnail_pulse: int | None
    """The frame of the newest thumbnail; None: there is none."""


class PersonElsewhere(msgspec.Struct, frozen=True):
    """A person whom another best-view service of the site serves, or whom another site has seen last."""

    object: int
    server: str | None
    """Its base URL; null if not configured."""
    site: str | None = None
    """The other site's name; null: it is of this one."""
    visible: bool | None = None
    """Whether the other site, or the service of another area, sees the person now; null: a service that all
    cameras send to."""
    token: bool = False
    """Whether it is another site that requires a token, and accepts that of the request."""


@dataclass(frozen=True, slots=True)
class Shard:
    """The best-view service of the site that a person belongs to."""

    index: int
    is_own: bool
    """Whether it is this service."""
    server: str | None
    """Its base URL; None where the configuration does not name it."""
    has_past: bool
    """Whether people come and go between services, so that this one has recorded some of their past."""


@dataclass(frozen=True, slots=True)
class PersonOverrides:
    """The operator's manual corrections."""

    names: dict[int, str]
    merged: dict[int, int]
    """By manually merged number: the number that was kept."""


@dataclass(frozen=True, slots=True)
class RenamePerson:
    """Command: set a person's name; an empty one removes it."""

    number: int
    name: str


@dataclass(frozen=True, slots=True)
class MergePeople:
    """Command: merge two people; the number ``kept`` remains."""

    kept: int
    lost: int


@dataclass(frozen=True, slots=True)
class SplitPerson:
    """Command: split these cameras' tracks off a person as a new person; an empty list: all cameras'."""

    number: int
    cameras: list[str]


class PeopleService:
    """Queries and commands about people."""

    def __init__(self, pipeline: BestViewPipeline) -> None:
        self._pipeline = pipeline

    def list_people(self) -> list[PersonSummary]:
        """Return all people who have a stream, by number."""
        people, thumbnails = self._pipeline.decider.people, self._thumbnails()
        summaries = []
        for number, view in sorted(self._pipeline.decision_state.selected_views.items()):
            thumbnail = self._newest(number, thumbnails.get(number, []))
            summaries.append(
                PersonSummary(
                    number=number,
                    name=people.registry.names.get(number),
                    former_numbers=people.registry.aliases(number),
                    first_seen=people.registry.first_seen.get(number, view.first),
                    last_seen=people.registry.last_seen.get(number, view.first),
                    camera=view.choice.camera,
                    cameras=list(view.cameras),
                    thumbnail_pulse=None if thumbnail is None else thumbnail.pulse,
                )
            )
        return summaries

    def list_elsewhere(self) -> list[PersonElsewhere]:
        """Return the people of the site's other services, by number; who has a view here is not one of them.

        Between two decisions another service may have taken somebody over already.
        """
        sharding, people = self._pipeline.config.view.sharding, self._pipeline.decider.people
        return [
            PersonElsewhere(
                number,
                shard_address(people.sharding.shard_of(number), sharding),
                visible=people.sharding.is_visible_elsewhere(number),
            )
            for number in people.of_other_shards
            if number not in self._pipeline.decision_state.selected_views
        ]

    @property
    def replacements(self) -> list[str]:
        """Addresses of the services that serve the same people."""
        return replacement_addresses(self._pipeline.config.view.sharding)

    def shard_of(self, number: int) -> Shard:
        """Return the service that a number belongs to, whether or not it is in use."""
        sharding = self._pipeline.config.view.sharding
        index = self._pipeline.decider.people.sharding.shard_of(number)
        return Shard(index, index == sharding.shard, shard_address(index, sharding), bool(sharding.areas))

    def is_reported(self, number: int) -> bool:
        """Return whether this service tells other systems about a person; of several areas the first does."""
        return self._pipeline.decider.people.sharding.is_reported(number)

    def current_number(self, number: int) -> int:
        """Return the current number of a merged one, as far as decisions have been published."""
        return self._pipeline.decision_state.resolve(number)

    def unknown(self, number: int) -> UnknownObjectError:
        """Return the error to raise for a number that no person has."""
        return UnknownObjectError(
            number, is_recovering=self._pipeline.state_replication.is_known_or_recoverable(number)
        )

    def numbered_since(self, number: int) -> float:
        """Return since when a number means the same person, unix seconds; infinite: unknown."""
        return self._pipeline.other_sites.numbered_since(number)

    def view_selection_of(self, number: int, pulse: int | None = None) -> ViewSelection | None:
        """Return why a person's newest view was selected, or that at a pulse of the last minute.

        Returns:
            None: there is no such person, or no reasons of that time.
        """
        selection = self._pipeline.decision_state.explain(number, pulse)
        return None if selection is None else view_selection_of(selection, self._pipeline.config.site.fps)

    def thumbnail_of(self, number: int) -> Thumbnail | None:
        """Return the newest thumbnail of a person, from the chosen camera where it has a recent one."""
        number = self.current_number(number)
        return self._newest(number, self._thumbnails().get(number, []))

    def subscribe_decisions(self, callback: Callable[[GopChoices], None]) -> None:
        """Call back with the choices of every GOP, as it is decided."""
        self._pipeline.on_decision.append(callback)

    def subscribe_other_decisions(self, callback: Callable[[DelayMode, GopChoices], None]) -> None:
        """Call back with the choices of every GOP for viewers who have chosen another delay."""
        self._pipeline.mode_publisher.on_decision.append(callback)

    @property
    def editing_blocked(self) -> str:
        """Why people cannot be renamed, merged or split here; empty: they can."""
        return self._pipeline.config.view.sharding.editing_blocked

    def manual_overrides(self) -> PersonOverrides:
        """Return the operator's names and merges."""
        people = self._pipeline.decider.people
        return PersonOverrides(dict(sorted(people.registry.names.items())), people.overrides.merged)

    def check_editable(self, number: int) -> None:
        """Check that a person can be edited.

        Raises:
            ConflictError: people cannot be edited here.
            UnknownObjectError: no person has this number.
        """
        self._editable(number)

    def rename_person(self, command: RenamePerson) -> None:
        """Set a person's name.

        Raises:
            ConflictError: people cannot be edited here.
            UnknownObjectError: no person has this number.
            InvalidCommandError: the name is too long or cannot be printed.
        """
        number, name = self._editable(command.number), " ".join(command.name.split())
        if len(name) > NAME_LENGTH_MAX or not name.isprintable():
            raise InvalidCommandError(f"name: at most {NAME_LENGTH_MAX} printable characters")
        self._pipeline.decider.people.registry.set_name(number, name)

    def merge_people(self, command: MergePeople) -> None:
        """Merge two people, permanently.

        Raises:
            ConflictError: people cannot be edited here.
            UnknownObjectError: no person has one of the numbers.
            InvalidCommandError: they are merged already.
        """
        kept, lost = self._editable(command.kept), self._editable(command.lost)
        if lost == kept:
            raise InvalidCommandError(f"object {command.lost} is object {kept} already")
        self._pipeline.decider.people.merge(kept, lost)

    def split_person(self, command: SplitPerson) -> int:
        """Split cameras' tracks off a person; return the new person's number.

        Raises:
            ConflictError: people cannot be edited here, or none of the cameras shows the person now.
            UnknownObjectError: no person has this number.
            UnknownCameraError: there is no such camera.
        """
        number, cameras = self._editable(command.number), list(self._pipeline.frame_buffers)
        for camera in command.cameras:
            if camera not in cameras:
                raise UnknownCameraError(camera, cameras)
        new = self._pipeline.decider.people.split_off(number, command.cameras or cameras)
        if new is None:
            raise ConflictError(f"no such camera shows object {number} now")
        return new

    def _editable(self, number: int) -> int:
        """Return a person's current number, which includes merges that are not published yet."""
        if self.editing_blocked:
            raise ConflictError(self.editing_blocked)
        people = self._pipeline.decider.people
        current = people.registry.current(number)
        if current not in people.known:
            raise self.unknown(number)
        return current

    def _thumbnails(self) -> dict[int, list[tuple[str, Thumbnail]]]:
        """Return every person's thumbnails by number, each with its camera."""
        thumbnails: dict[int, list[tuple[str, Thumbnail]]] = {}
        for (camera, boot, track), thumbnail in self._pipeline.ingest.thumbnails.items():
            number = self._pipeline.decider.people.person_of(camera, boot, track, thumbnail.pulse)
            if number is not None:
                thumbnails.setdefault(number, []).append((camera, thumbnail))
        return thumbnails

    def _newest(self, number: int, thumbnails: list[tuple[str, Thumbnail]]) -> Thumbnail | None:
        if not thumbnails:
            return None
        view = self._pipeline.decision_state.selected_views.get(number)
        chosen = view.choice.camera if view else None
        newest = max(thumbnail.pulse for _, thumbnail in thumbnails)
        recent = newest - round(_THUMBNAIL_RECENT_S * self._pipeline.config.site.fps)
        return max(
            thumbnails,
            key=lambda candidate: (
                candidate[0] == chosen and candidate[1].pulse >= recent,
                candidate[1].pulse,
            ),
        )[1]
