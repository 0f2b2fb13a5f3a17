"""Everybody who has a number, and how numbers are given, told, merged and taken back."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from bestview.association.affinity.affinity_matrix import PairTables
from bestview.association.appearance.cross_camera import LooksBetween
from bestview.association.registry.corrections import Merge
from bestview.association.registry.id_assignment import named
from bestview.association.registry.new_people import Lost, Newcomers
from bestview.association.registry.person import Person
from bestview.association.settings import IdentitySettings
from bestview.association.tracklet import Episode
from bestview.association.tracklet_groups import Group


class People:
    """The persons by number."""

    def __init__(self, settings: IdentitySettings, cameras: int) -> None:
        self._settings = settings
        self._newcomers = Newcomers(settings, cameras)
        self._persons: dict[int, Person] = {}
        self.next_number = 1
        """The first that nobody was given yet."""

    def __len__(self) -> int:
        """Count everybody remembered."""
        return len(self._persons)

    def __contains__(self, number: object) -> bool:
        """Say whether somebody of this number is remembered."""
        return number in self._persons

    def recent(self, frame: int) -> list[Person]:
        """List those who are compared like everybody, by number: some episode of theirs is settled."""
        oldest = frame - self._settings.comparable_frames
        return [it for _, it in sorted(self._persons.items()) if it.settled and it.last >= oldest]

    def name(
        self,
        groups: Sequence[Group],
        tables: PairTables,
        between: LooksBetween,
        frame: int,
        silent: Callable[[Group], int],
    ) -> tuple[tuple[int, ...], tuple[Merge, ...]]:
        """Give the groups their numbers, and those of their episodes; say who is new, and who was merged.

        `silent` says how many cameras should see a group and do not.
        """
        told = [{it: n for it, n in group.told.items() if it in self._persons} for group in groups]
        for group, number in zip(groups, named(told), strict=True):
            group.number = number
        born = self._number_new(groups, tables, between, frame, silent)
        for group in groups:
            for episode in group.episodes:
                episode.number = group.number
            if group.number:
                person = self._persons[group.number]
                for episode in group.episodes:
                    person.see(episode.key.camera, episode.end.frame)
                for before in group.past:
                    person.see(before.camera, before.last)
        self._newcomers.see_at_once((it for it in groups if it.number), frame)
        return born, self._merge(groups, frame)

    def _number_new(
        self,
        groups: Sequence[Group],
        tables: PairTables,
        between: LooksBetween,
        frame: int,
        silent: Callable[[Group], int],
    ) -> tuple[int, ...]:
        """Number those who were seen often enough: a new number, or that of the lost person they are."""
        new = [it for it in groups if it.episodes and not it.number and self._is_sure(it, frame, silent)]
        new.sort(key=lambda it: (it.first, it.rows[0]))
        here = {it.number: it for it in groups if it.number}
        lost = [
            Lost(person, here.get(number))
            for number, person in sorted(self._persons.items())
            if number not in here or here[number].last < frame - self._settings.gap_frames
        ]
        found = self._newcomers.match(new, lost, tables, between, frame)
        born = []
        for group, match in zip(new, found, strict=True):
            if match >= 0:
                group.number = lost[match].person.number
                continue
            group.number = self.next_number
            self._persons[group.number] = Person(group.number)
            born.append(group.number)
            self.next_number += 1
        return tuple(born)

    def _is_sure(self, new: Group, frame: int, silent: Callable[[Group], int]) -> bool:
        """Say whether a group is seen lately, and was seen often enough to be somebody."""
        settings = self._settings
        if (
            new.frames < settings.confirmation_frames
            or new.last < frame - settings.gap_frames - settings.clustering_interval
        ):
            return False
        doubted = max(0, silent(new) - len(new.cameras) + 1) if settings.ghost_penalty else 0
        return new.frames >= settings.confirmation_frames * (1.0 + settings.ghost_penalty * doubted)

    def _merge(self, groups: Sequence[Group], frame: int) -> tuple[Merge, ...]:
        """Merge numbers that have been nobody's for long: whoever had them is in somebody else's group."""
        into = _whose_now(groups)
        merged = []
        for number, person in sorted(self._persons.items()):
            if number not in into:
                person.nobody_since = -1
            elif person.nobody_since < 0:
                person.nobody_since = frame
            elif frame - person.nobody_since >= self._settings.merge_after:
                merged.append(Merge(into[number], number))
        for merge in merged:
            self._persons[merge.kept].absorb(self._persons.pop(merge.lost))
        return tuple(merged)

    def part(self, people: Iterable[int], cameras: Iterable[str], frame: int) -> int:
        """Give the number of somebody new whom some cameras see, and whom these people were taken for."""
        new = Person(self.next_number)
        self.next_number += 1
        self._persons[new.number] = new
        for camera in cameras:
            new.see(camera, frame)
        self.root([new.number, *people])
        return new.number

    def begin_at(self, number: int) -> None:
        """Give no number below this one any more."""
        self.next_number = max(self.next_number, number)

    def recall(self, number: int, frame: int) -> None:
        """Know somebody of this number, who was here before a frame."""
        self.begin_at(number + 1)
        self._persons.setdefault(number, Person(number, frame))

    def root(self, numbers: Iterable[int]) -> None:
        """Let people have a row among those who are compared, by which they can be kept apart."""
        for number in numbers:
            self._persons[number].settled = max(1, self._persons[number].settled)

    def settle(self, episodes: Iterable[Episode]) -> None:
        """Take over episodes that stay whose they were told to be."""
        for episode in episodes:
            person = self._persons.get(episode.mostly)
            if person is not None:
                person.looks.add_all(episode.looks)
                person.settled += episode.told[person.number]

    def see(self, seen: Iterable[tuple[int, str]], frame: int) -> None:
        """Note whom cameras see whose tracks are settled though they go on."""
        for number, camera in seen:
            if number in self._persons:
                self._persons[number].see(camera, frame)

    def comings_and_goings(
        self, episodes: Iterable[Episode], frame: int
    ) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Say who of those who had gone is back, and whom no camera has seen for a while: their numbers."""
        for episode in episodes:
            person = self._persons.get(episode.number)
            if person is not None:
                person.see(episode.key.camera, episode.end.frame)
        returned: list[int] = []
        gone: list[int] = []
        for number, person in sorted(self._persons.items()):
            away = frame - person.last > self._settings.departed_after
            if away != person.gone:
                (gone if away else returned).append(number)
                person.gone = away
        return tuple(returned), tuple(gone)

    def forget(self, frame: int) -> None:
        """Forget whoever was gone for too long."""
        settings = self._settings
        settled = frame - settings.settle_after
        gone = sorted(
            (it.last, number) for number, it in self._persons.items() if it.gone and it.last < settled
        )
        surplus = len(gone) - settings.maximum_departed_people
        for i, (last, number) in enumerate(gone):
            if i < surplus or frame - last > settings.forget_after:
                del self._persons[number]


def _whose_now(groups: Sequence[Group]) -> dict[int, int]:
    """Give the numbers that are no group's, though told: by number, that of most who were told so."""
    most: dict[int, tuple[int, int]] = {}
    for group in groups:
        for number, frames in group.told.items():
            if group.number and frames > most.get(number, (0, 0))[0]:
                most[number] = (frames, group.number)
    here = {group.number for group in groups}
    return {number: other for number, (_, other) in most.items() if number not in here}
