"""Everybody who has a number, and how numbers are given, told, merged and taken back."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from bestview.between import LooksBetween
from bestview.corrections import Merge
from bestview.episodes import Episode
from bestview.finding import find_again
from bestview.groups import Group
from bestview.identity_settings import IdentitySettings
from bestview.looks import Looks
from bestview.naming import named
from bestview.pairs import PairTables
from bestview.persons import Person


class People:
    """The persons by number."""

    def __init__(self, settings: IdentitySettings) -> None:
        self._settings = settings
        self._persons: dict[int, Person] = {}
        self._next_number = 1

    def __len__(self) -> int:
        """Count everybody remembered."""
        return len(self._persons)

    def recent(self, frame: int) -> list[Person]:
        """List those who are compared like everybody, by number: some episode of theirs is settled."""
        oldest = frame - self._settings.recent
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
                person.last = max(person.last, group.last)
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
            person
            for number, person in sorted(self._persons.items())
            if number not in here or here[number].last < frame - self._settings.gap
        ]
        before = [here.get(person.number) for person in lost]
        looks = [_looks(person, group) for person, group in zip(lost, before, strict=True)]
        asked = [(it, *who) for it in new for who in zip(lost, before, strict=True)]
        possible = np.array([self._may_be(*one, tables, between, frame) for one in asked], dtype=np.bool_)
        possible = possible.reshape(len(new), len(lost))
        found = find_again(between.appearances, [it.looks for it in new], looks, possible, between.gate)
        born = []
        for group, match in zip(new, found, strict=True):
            if match >= 0:
                group.number = lost[match].number
                continue
            group.number = self._next_number
            self._persons[group.number] = Person(group.number)
            born.append(group.number)
            self._next_number += 1
        return tuple(born)

    def _is_sure(self, new: Group, frame: int, silent: Callable[[Group], int]) -> bool:
        """Say whether a group is seen lately, and was seen often enough to be somebody."""
        settings = self._settings
        if new.frames < settings.confirm or new.last < frame - settings.gap - settings.regroup:
            return False
        doubted = max(0, silent(new) - len(new.cameras) + 1) if settings.doubt else 0
        return new.frames >= settings.confirm * (1.0 + settings.doubt * doubted)

    def _may_be(
        self,
        new: Group,
        person: Person,
        before: Group | None,
        tables: PairTables,
        between: LooksBetween,
        frame: int,
    ) -> bool:
        """Say whether looks alone may tell that somebody is one of the lost."""
        if before is None:
            # Who has no group though they are compared with everybody is in somebody else's.
            return person.last < frame - self._settings.recent
        # Where there was something to compare by, grouping has had its say.
        compared = bool(new.cameras & before.cameras) or between.share_ground(new.cameras, before.cameras)
        return not compared and not tables.any_apart(new.rows, before.rows)

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

    def settle(self, episodes: Iterable[Episode]) -> None:
        """Take over episodes that stay whose they were told to be."""
        for episode in episodes:
            person = self._persons.get(episode.mostly)
            if person is not None:
                person.looks.add_all(episode.looks)
                person.settled += episode.told[person.number]

    def see(self, numbers: Iterable[int], frame: int) -> None:
        """Note that people are seen whose tracks are settled though they go on."""
        for number in numbers:
            if number in self._persons:
                self._persons[number].last = max(self._persons[number].last, frame)

    def comings_and_goings(
        self, episodes: Iterable[Episode], frame: int
    ) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Say who of those who had gone is back, and whom no camera has seen for a while: their numbers."""
        for episode in episodes:
            person = self._persons.get(episode.number)
            if person is not None:
                person.last = max(person.last, episode.end.frame)
        returned: list[int] = []
        gone: list[int] = []
        for number, person in sorted(self._persons.items()):
            away = frame - person.last > self._settings.gone_after
            if away != person.gone:
                (gone if away else returned).append(number)
                person.gone = away
        return tuple(returned), tuple(gone)

    def forget(self, frame: int) -> None:
        """Forget whoever was gone for too long."""
        settings = self._settings
        settled = frame - settings.settled_after
        gone = sorted(
            (it.last, number) for number, it in self._persons.items() if it.gone and it.last < settled
        )
        surplus = len(gone) - settings.remember
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


def _looks(person: Person, group: Group | None) -> Looks:
    """How somebody looks who is lost: with what is not settled yet."""
    return person.looks if group is None else group.looks
