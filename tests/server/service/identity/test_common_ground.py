"""People who are tracked jointly have one number in all cameras, also over restarts."""

from __future__ import annotations

import numpy as np

from bestview import Merge, Split
from fakes.service.joint_floor import FPS, SIZE, VIEWS, joint_config, walk_past, walked_epochs
from fakes.tracking.walked_floor import FloorNoise
from server.service.identity.local_numbers import TrackName
from server.service.identity.person_tracker import PersonTracker
from server.service.ingest.epoch_aligner import Epoch
from server.service.joint_tracking.stage import JointStage
from server.service.view_selection.decider import camera_homographies
from tracking.boxes import Floats, iou


def person_tracker() -> PersonTracker:
    config = joint_config()
    return PersonTracker(
        config.view.identity,
        config.camera_ids,
        camera_homographies(config),
        SIZE,
        config.track.final_lag(FPS),
        fps=FPS,
        joint_cameras=config.joint_cameras,
    )


def follow(people: PersonTracker, epochs: list[Epoch], stage: JointStage | None = None) -> None:
    stage = stage or JointStage(joint_config())
    for epoch in epochs:
        people.update(stage.step(epoch))


def numbers_of(people: PersonTracker, walks: Floats, frame: int) -> list[set[int]]:
    """Return the numbers of each person's boxes in a frame, over all cameras."""
    found: list[set[int]] = [set() for _ in walks[frame]]
    for name, view in VIEWS.items():
        for number, *box in people.boxes(name, frame, 1)[0]:
            overlaps = [iou(np.array(box), view.box(place)) for place in walks[frame]]
            found[int(np.argmax(overlaps))].add(number)
    return found


def test_one_number_in_all_cameras_though_boxes_are_missed() -> None:
    walks, people = walk_past(), person_tracker()
    follow(people, list(walked_epochs(walks, noise=FloorNoise(missed=0.1, deviation=0.005))))
    assert people.registry.all_numbers == [1, 2]
    for frame in range(10, 36):
        assert numbers_of(people, walks, frame) in ([{1}, {2}], [{2}, {1}])


def test_numbers_survive_a_new_process_that_tracks() -> None:
    walks, people = walk_past(), person_tracker()
    epochs = list(walked_epochs(walks))
    follow(people, epochs[:10])
    before = numbers_of(people, walks, 15)
    again = JointStage(joint_config())
    assert again._tracker is not None
    again._tracker._run = 1
    follow(people, epochs[10:], again)
    assert numbers_of(people, walks, 36) == before
    assert people.registry.all_numbers == [1, 2]


def test_a_cameras_own_tracks_name_the_people_whom_they_show() -> None:
    walks, people = walk_past(), person_tracker()
    follow(people, list(walked_epochs(walks)))
    for person, (number,) in enumerate(numbers_of(people, walks, 30)):
        for name in VIEWS:
            assert people.person_of(name, 1, person + 1, 30) == number
        assert people.tracks_of([number], 0)[number] == [TrackName(name, 1, person + 1) for name in VIEWS]
    assert people.person_of("c0", 1, 99, 30) is None
    assert people.person_of("c0", 2, 1, 30) is None


def test_people_are_recalled_by_the_cameras_own_tracks_after_a_restart_of_the_service() -> None:
    walks = walk_past()
    epochs = list(walked_epochs(walks))
    people = person_tracker()
    people.identity.reserve_below(9)
    people.expect({TrackName("c1", 1, 1): 7, TrackName("c2", 1, 2): 5}, -1)
    follow(people, epochs)
    assert numbers_of(people, walks, 30) == [{7}, {5}]


def test_an_operator_splits_off_whom_a_camera_shows() -> None:
    walks, people = walk_past(), person_tracker()
    epochs, stage = list(walked_epochs(walks)), JointStage(joint_config())
    follow(people, epochs[:12], stage)
    ((number,), _) = numbers_of(people, walks, 18)
    new = people.split_off(number, ["c1"])
    assert new == 3
    follow(people, epochs[12:], stage)
    assert numbers_of(people, walks, 34)[0] == {new}, "the person is the same in all cameras"
    corrections = people.take_corrections()
    assert not [each for each in corrections if isinstance(each, Merge)]
    splits = [each for each in corrections if isinstance(each, Split)]
    assert [split.camera for split in splits] == list(VIEWS)
