"""Removes people from everything that the service keeps in memory, and from what cameras keep for it."""

from __future__ import annotations

from collections.abc import Collection
from functools import partial
from typing import TYPE_CHECKING

from server.service.deletion.decision_rows import without_people

if TYPE_CHECKING:
    from server.service.pipeline import BestViewPipeline


def forget_people(pipeline: BestViewPipeline, numbers: Collection[int]) -> None:
    """Forget people without blocking: from the next decision on no one has these numbers.

    Who is visible gets another number, and nothing says that it is theirs. Their streams end.
    """
    people = pipeline.decider.people
    tracks = people.forget(numbers)
    pipeline.ingest.forget_thumbnails((track.camera, track.boot, track.track) for track in tracks)
    pipeline.decision_state.forget(numbers)
    without = partial(without_people, numbers=numbers)
    pipeline.recorder.recent.replace(without)
    pipeline.mode_publisher.replace_balanced(without)
    pipeline.assist.flags.forget(numbers)
    pipeline.rules.forget(numbers)
    pipeline.state_replication.forget(numbers)
    pipeline.splicer.forget(people.known, people.registry.merged)
