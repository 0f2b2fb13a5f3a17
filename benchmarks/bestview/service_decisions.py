"""Decisions of the best-view service's classes, on track messages or on boxes with true ids."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, zip_longest
from pathlib import Path

import numpy as np

from benchmarks.bestview.camera_tracks import Messages, Rows
from bestview import NO_CAMERA, IdentityUpdate, TrackletKey, TrackUpdate, size_quality
from server.cli.evaluate.choices_file import Choice, read_choices
from server.config.site_config import Config
from server.messaging.epochs import epoch_of_recording_end
from server.messaging.messages import Box, CameraTracks, NumberedBox, TrackMessage
from server.messaging.packed_arrays import pack_boxes
from server.service.decision_files.decision_writer import DecisionWriter
from server.service.ingest.epoch_aligner import EpochAligner
from server.service.joint_tracking.stage import JointStage
from server.service.view_selection.decider import GopDecision, ViewDecider, camera_homographies
from tracking.boxes import Floats
from tracking.motchallenge import MotRow, read_rows


@dataclass(frozen=True, slots=True)
class Rendering:
    """What `myview render` would write: tracks by person, and the selected cameras."""

    tracks: dict[str, list[MotRow]]
    choices: list[Choice]
    occupied: dict[str, dict[int, list[NumberedBox] | None]] = field(default_factory=dict)
    """By camera and frame: the regions with people, where `access` may blur them."""


class GroundTruthRegistry:
    """A person registry that knows the ground truth: a local track id is an index in `people`."""

    def __init__(self, people: Sequence[int]) -> None:
        self._people = people

    def update(
        self, tracks: Sequence[TrackUpdate], last_frame: int, picture_sizes: Mapping[str, tuple[int, int]]
    ) -> IdentityUpdate:
        """Return the id of every tracklet."""
        del last_frame, picture_sizes
        numbers = {TrackletKey(*track.key, 0): self._people[track.key.local_id - 1] for track in tracks}
        return IdentityUpdate(numbers, created=(), returned=(), departed=(), merged=(), split=())


def decide(config: Config, messages: Messages, people: Sequence[int] | None = None) -> Rendering:
    """Align the cameras' messages, associate tracks and select views; with `people`, true ids are given."""
    aligner = EpochAligner(config.camera_ids, config.window.stride, grace=0)
    last = {camera: camera_messages[-1].last for camera, camera_messages in messages.items()}
    decider = ViewDecider(
        config, camera_homographies(config), lambda camera, pulse: 0 <= pulse <= last[camera]
    )
    if people is not None:
        decider.people._registry = GroundTruthRegistry(people)  # type: ignore[assignment]  # noqa: SLF001 — ground truth
    joint = JointStage(config)
    for camera in config.camera_ids:
        aligner.camera_connected(camera)
        aligner.frame_received(camera, messages[camera][0].boot, 0)
    occupied: dict[str, dict[int, list[NumberedBox] | None]] = {camera: {} for camera in config.camera_ids}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        def write(decision: GopDecision) -> None:
            recorder.write(decision)
            for camera, regions in decision.occupied.items():
                occupied[camera].update(enumerate(regions, start=decision.first))

        recorder = DecisionWriter(folder, config.camera_ids, decider.people.letterboxes)
        for message in chain.from_iterable(zip_longest(*messages.values())):
            if message is not None:
                aligner.add_tracks(message)
            for epoch in aligner.take_ready(now=-1):
                for decision in decider.step(joint.step(epoch)):
                    write(decision)
        for decision in decider.finish(max(last.values())):
            write(decision)
        recorder.close()
        tracks = {camera: read_rows(folder / "tracks" / f"{camera}.txt") for camera in config.camera_ids}
        return Rendering(tracks, read_choices(folder / "choices.csv"), occupied)


def decide_with_true_ids(config: Config, rows: Rows, frames: int) -> Rendering:
    """Select views by final boxes with true ids."""
    people = sorted({row.id for found in rows.values() for row in found})
    messages = {camera: _messages_of(config, camera, found, people, frames) for camera, found in rows.items()}
    return decide(config, messages, people)


def _messages_of(
    config: Config, camera: str, rows: Sequence[MotRow], people: Sequence[int], frames: int
) -> list[CameraTracks]:
    """Build track messages with all people in each, so that local track ids are indices in `people`."""
    stride = config.window.stride
    boxes: dict[tuple[int, int], Box] = {(row.id, row.frame - 1): row.box for row in rows}
    spans = [(end - stride + 1, end) for end in range(stride - 1, frames, stride)]
    spans.append((frames - frames % stride, frames - 1))
    return [
        CameraTracks(
            camera=camera,
            boot=1,
            size=(config.site.width, config.site.height),
            epoch=epoch_of_recording_end(last, stride) if place == len(spans) - 1 else place,
            first=first,
            last=last,
            final_to=last,
            ended=place == len(spans) - 1,
            shed=[],
            tracks=[
                TrackMessage(
                    id=number + 1,
                    boxes=pack_boxes([boxes.get((person, frame)) for frame in range(first, last + 1)]),
                    confidence=1.0,
                )
                for number, person in enumerate(people)
            ],
            solve=None,
        )
        for place, (first, last) in enumerate(spans)
    ]


def largest(rows: Rows, sizes: Mapping[str, tuple[int, int]], frames: int) -> list[Choice]:
    """Select in each frame the camera with the largest box of a person; ties go to the first."""
    cameras = list(rows)
    people = sorted({row.id for found in rows.values() for row in found})
    place = {person: index for index, person in enumerate(people)}
    quality: Floats = np.zeros((len(people), frames, len(cameras)))
    for column, (camera, found) in enumerate(rows.items()):
        for row in found:
            if row.frame <= frames:
                size = float(size_quality(np.array(row.box), *sizes[camera]))
                quality[place[row.id], row.frame - 1, column] = size
    views = np.where(quality.max(axis=2) > 0.0, quality.argmax(axis=2), NO_CAMERA)
    return [
        Choice(frame + 1, person, cameras[view])
        for person, line in zip(people, views.tolist(), strict=True)
        for frame, view in enumerate(line)
        if view != NO_CAMERA
    ]
