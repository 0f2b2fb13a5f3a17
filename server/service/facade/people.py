"""People: who is known, which camera shows them and why, and what the operator corrects by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import msgspec

from server.messaging.identity_snapshot import NAME_LENGTH_MAX
from server.messaging.messages import GopChoices
from server.service.decision_state import reason
from server.service.facade.errors import (
    ConflictError,
    InvalidCommandError,
    UnknownCameraError,
    UnknownObjectError,
)
from server.service.identity.sharding import shard_address, shard_of
from server.service.ingest.ingest import Thumbnail
from server.service.pipeline import BestViewPipeline

__all__ = [
    "MergePeople",
    "PeopleService",
    "PersonOverrides",
    "PersonSummary",
    "RemotePerson",
    "RenamePerson",
    "Shard",
    "SplitPerson",
    "Thumbnail",
    "ViewSelection",
]

_THUMBNAIL_RECENT_S = 3
"""A thumbnail of the chosen camera is preferred to newer ones of other cameras while it is no older."""


@dataclass(frozen=True, slots=True)
class PersonSummary:
    """One person who has a stream. Pulses are frame numbers of the site."""

    number: int
    name: str | None
    former_numbers: list[int]
    """Numbers that were merged into this one; they still resolve."""
    first_seen: int
    last_seen: int
    camera: str | None
    """The camera that shows the person now."""
    cameras: list[str]
    """The cameras that see the person now."""
    thumbnail_pulse: int | None
    """The frame that the newest thumbnail is of; None: there is no thumbnail."""


@dataclass(frozen=True, slots=True)
class RemotePerson:
    """A person whom another best-view service of the site decides for."""

    number: int
    server: str | None
    """Base URL of that service; None where the configuration does not name it."""


@dataclass(frozen=True, slots=True)
class Shard:
    """The best-view service of the site that decides for a person."""

    index: int
    is_own: bool
    """Whether it is this one."""
    server: str | None
    """Its base URL; None where the configuration does not name it."""


class ViewSelection(msgspec.Struct, frozen=True):
    """Why this view."""

    object: int
    first: int
    """First pulse of the newest decided GOP."""
    frames: int
    camera: str | None
    since: int
    """Pulse of the last cut."""
    costs: dict[str, float | None]
    """Mean cost a frame of each camera over the look-ahead; null: cannot be shown."""
    seen: dict[str, float]
    """Share of the look-ahead in which each camera sees the person."""
    quality: dict[str, float | None]
    """How well each camera shows the person where it sees them, 0 to 1; null: it does not."""
    terms: dict[str, dict[str, float]]
    """By camera: the terms of that quality, likewise; empty where it does not see the person."""
    undetected: dict[str, float]
    """Share of the look-ahead in which each camera does not find the person, who stands before it as the
    others know."""
    undetected_quality: dict[str, float | None]
    """What such a view is taken to be worth: quality, times how surely they show; null: there is none."""
    weights: dict[str, float]
    """By term: the share of a view's worth that is lost where the term is 0."""
    before: str | None
    """The camera of the GOP before; null: there was none."""
    lookahead: int
    """Frames from `first` on that were looked at."""
    switch_cost: float
    """What a cut costs, in frames of not seeing the person."""
    stay: float | None
    """What the look-ahead costs with `before`, likewise; null: there is none, or it cannot be shown."""
    cut: float | None
    """What it costs with the best other camera, the cut included; null: there is none."""
    cut_to: str | None
    """That camera."""
    reason: str


@dataclass(frozen=True, slots=True)
class PersonOverrides:
    """What the operator has corrected by hand."""

    names: dict[int, str]
    merged: dict[int, int]
    """By number that was merged by hand: the number it was merged into."""


@dataclass(frozen=True, slots=True)
class RenamePerson:
    """Command: give a person a name; an empty one takes it away."""

    number: int
    name: str


@dataclass(frozen=True, slots=True)
class MergePeople:
    """Command: two numbers are one person's; ``kept`` stays."""

    kept: int
    lost: int


@dataclass(frozen=True, slots=True)
class SplitPerson:
    """Command: whom these cameras show as this person is a new person; no cameras: all of them."""

    number: int
    cameras: list[str]


class PeopleService:
    """Queries and commands about people."""

    def __init__(self, pipeline: BestViewPipeline) -> None:
        self._pipeline = pipeline

    def list_people(self) -> list[PersonSummary]:
        """Return everybody who has a stream, by number."""
        people, thumbnails = self._pipeline.decider.people, self._thumbnails()
        summaries = []
        for number, standing in sorted(self._pipeline.decision_state.selected_views.items()):
            thumbnail = self._newest(number, thumbnails.get(number, []))
            summaries.append(
                PersonSummary(
                    number=number,
                    name=people.registry.names.get(number),
                    former_numbers=people.registry.aliases(number),
                    first_seen=people.registry.first_seen.get(number, standing.first),
                    last_seen=people.registry.last_seen.get(number, standing.first),
                    camera=standing.choice.camera,
                    cameras=list(standing.cameras),
                    thumbnail_pulse=None if thumbnail is None else thumbnail.pulse,
                )
            )
        return summaries

    def list_remote_people(self) -> list[RemotePerson]:
        """Return the people whom other services of the site decide for, by number."""
        share = self._pipeline.config.view.share
        return [RemotePerson(it, shard_address(it, share)) for it in self._pipeline.decider.people.remote]

    def shard_of(self, number: int) -> Shard:
        """Return the service that decides for a number, which need not be anybody's."""
        share = self._pipeline.config.view.share
        index = shard_of(number, share)
        return Shard(index, index == share.index, shard_address(number, share))

    def current_number(self, number: int) -> int:
        """Return the number that a merged one goes by now, as far as decisions have been published."""
        return self._pipeline.decision_state.resolve(number)

    def unknown(self, number: int) -> UnknownObjectError:
        """Return the error to raise where nobody has this number."""
        return UnknownObjectError(number, is_recovering=self._pipeline.state_replication.may_recover(number))

    @property
    def numbered_since(self) -> float:
        """Unix seconds since when numbers mean the same people."""
        return self._pipeline.state_replication.numbers_since

    def view_selection_of(self, number: int, pulse: int | None = None) -> ViewSelection | None:
        """Return why a person's newest view was selected, or that at a pulse of the last minute.

        Returns:
            None: there is no such person, or nothing is kept of that time.
        """
        explained = self._pipeline.decision_state.explain(number, pulse)
        if explained is None:
            return None
        standing, why = explained.standing, explained.why
        return ViewSelection(
            object=standing.choice.number,
            first=standing.first,
            frames=standing.frames,
            camera=standing.choice.camera,
            since=standing.since,
            costs={camera: view.cost for camera, view in why.views.items()},
            seen={camera: view.seen for camera, view in why.views.items()},
            quality={camera: view.quality for camera, view in why.views.items()},
            terms={camera: view.terms for camera, view in why.views.items()},
            undetected={camera: view.undetected for camera, view in why.views.items()},
            undetected_quality={camera: view.undetected_quality for camera, view in why.views.items()},
            weights=why.weights,
            before=standing.choice.before,
            lookahead=why.frames,
            switch_cost=why.switch_cost,
            stay=why.stay,
            cut=why.cut,
            cut_to=why.cut_to,
            reason=reason(standing.choice, why),
        )

    def thumbnail_of(self, number: int) -> Thumbnail | None:
        """Return the newest thumbnail of a person, from the chosen camera where it has a recent one."""
        number = self.current_number(number)
        return self._newest(number, self._thumbnails().get(number, []))

    def subscribe_decisions(self, callback: Callable[[GopChoices], None]) -> None:
        """Call back with the choices about every GOP, as it is decided."""
        self._pipeline.on_decision.append(callback)

    @property
    def editing_blocked(self) -> str:
        """Why people cannot be renamed, merged or split here; empty: they can."""
        if self._pipeline.config.view.share.of > 1:
            return "several services share this site (view.share): they must agree who is who, by themselves"
        return ""

    def manual_overrides(self) -> PersonOverrides:
        """Return the names and merges that the operator has given."""
        people = self._pipeline.decider.people
        return PersonOverrides(dict(sorted(people.registry.names.items())), people.merged_by_hand)

    def check_editable(self, number: int) -> None:
        """Check that a person can be edited.

        Raises:
            ConflictError: people cannot be edited here.
            UnknownObjectError: nobody has this number.
        """
        self._editable(number)

    def rename_person(self, command: RenamePerson) -> None:
        """Name a person.

        Raises:
            ConflictError: people cannot be edited here.
            UnknownObjectError: nobody has this number.
            InvalidCommandError: the name is too long or cannot be printed.
        """
        number, name = self._editable(command.number), " ".join(command.name.split())
        if len(name) > NAME_LENGTH_MAX or not name.isprintable():
            raise InvalidCommandError(f"name: at most {NAME_LENGTH_MAX} letters that can be read")
        self._pipeline.decider.people.registry.set_name(number, name)

    def merge_people(self, command: MergePeople) -> None:
        """Merge one person's number into another's, whatever the evidence says from now on.

        Raises:
            ConflictError: people cannot be edited here.
            UnknownObjectError: nobody has one of the numbers.
            InvalidCommandError: they are one person's already.
        """
        kept, lost = self._editable(command.kept), self._editable(command.lost)
        if lost == kept:
            raise InvalidCommandError(f"object {command.lost} is object {kept} already")
        self._pipeline.decider.people.merge(kept, lost)

    def split_person(self, command: SplitPerson) -> int:
        """Split off whom these cameras show as a person; return the new person's number.

        Raises:
            ConflictError: people cannot be edited here, or none of the cameras shows the person now.
            UnknownObjectError: nobody has this number.
            UnknownCameraError: a camera of this name does not exist.
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
        """Return the number that a person goes by, also where a merge has not been published yet."""
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
        standing = self._pipeline.decision_state.selected_views.get(number)
        chosen = standing.choice.camera if standing else None
        newest = max(thumbnail.pulse for _, thumbnail in thumbnails)
        recent = newest - round(_THUMBNAIL_RECENT_S * self._pipeline.config.site.fps)
        return max(thumbnails, key=lambda it: (it[0] == chosen and it[1].pulse >= recent, it[1].pulse))[1]
