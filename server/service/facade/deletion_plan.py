"""The plan of a deletion: what is deleted of a person, and what others lose."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from server.service.deletion.recorded_traces import RecordedTraces


class CameraLoss(msgspec.Struct, frozen=True):
    """What one camera's recording has of a person, and loses with the recordings."""

    camera: str
    seen_s: float
    """Seconds in which it saw them."""
    deleted_s: float
    """Seconds of its recording in the files that hold these: whole files are deleted."""


class OtherLoss(msgspec.Struct, frozen=True):
    """What goes of the recorded best view of another person with the recordings."""

    object: int
    run: str | None
    """The folder of an earlier session with other numbers; null: they are today's."""
    name: str | None
    deleted_s: float


class PersonDeletion(msgspec.Struct, frozen=True):
    """What is deleted of a person, or would be."""

    object: int
    run: str | None
    state: str
    """planned, running (it goes on) or done."""
    recordings: str | None
    """keep or delete: what was asked for; null while it is planned."""
    objects: list[int]
    """All numbers of this person."""
    name: str | None
    visible: bool
    """Whether a camera sees them now: who goes on being visible gets another number."""
    events: int
    """Events of rules that mention them."""
    decisions: int
    """Recorded GOPs whose rows lose them."""
    seen_s: float
    """Seconds of the recording in which any camera saw them."""
    cameras: list[CameraLoss]
    """Deleted only with the recordings."""
    sound_s: float
    """Seconds of recorded sound that go with the recordings."""
    others: list[OtherLoss]
    """Other people whose recorded best views become shorter with the recordings."""
    mentions: list[str]
    """Where files that only you can change mention the person."""


def camera_losses(traces: RecordedTraces) -> list[CameraLoss]:
    """Return what each camera's recording has of a person."""
    seen: dict[str, float] = {}
    deleted: dict[str, float] = {}
    for each in traces.sessions:
        fps = each.session.info.fps
        for camera, spans in each.visible.items():
            seen[camera] = seen.get(camera, 0.0) + sum(span.end - span.first for span in spans) / fps
            deleted[camera] = deleted.get(camera, 0.0) + each.lost[camera] / fps
    return [CameraLoss(camera, rounded(seen[camera]), rounded(deleted[camera])) for camera in sorted(seen)]


def other_losses(traces: RecordedTraces, run: str | None, names: Mapping[int, str]) -> list[OtherLoss]:
    """Return what other people lose; ``run`` and ``names`` are those of their numbers."""
    lost: dict[int, float] = {}
    for each in traces.sessions:
        for number, frames in each.lost_by_others.items():
            lost[number] = lost.get(number, 0.0) + frames / each.session.info.fps
    return [
        OtherLoss(number, run, names.get(number), rounded(seconds))
        for number, seconds in sorted(lost.items())
    ]


def rounded(seconds: float) -> float:
    """Return seconds to the millisecond."""
    return round(seconds, 3)
