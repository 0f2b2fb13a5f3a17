"""Several revisions of the past may arrive late, in one epoch."""

from __future__ import annotations

import msgspec
import pytest

from bestview import IdentitySettings
from fakes.service.scripted_cameras import HEIGHT, STRIDE, WIDTH, camera_tracks, epoch_of
from server.messaging.epochs import end_of_epoch
from server.messaging.messages import Box, CameraTracks
from server.messaging.packed_arrays import first_boxes
from server.service.identity.person_tracker import PersonTracker
from server.service.ingest.epoch_aligner import Epoch

LEFT: Box = (10.0, 20.0, 40.0, 110.0)
RIGHT: Box = (100.0, 20.0, 130.0, 110.0)
REVISED_FROM = STRIDE
"""The first frame with exchanged identities."""


def late_revision(epoch: int) -> CameraTracks:
    """Return a revision in which the two people have been exchanged since `REVISED_FROM`."""
    last = end_of_epoch(epoch, STRIDE)
    revision = camera_tracks("c0", epoch, {1: RIGHT, 2: LEFT}, first=REVISED_FROM, revised_from=REVISED_FROM)
    frames = last - REVISED_FROM + 1
    tracks = [
        msgspec.structs.replace(track, boxes=first_boxes(track.boxes, 1) * frames)
        for track in revision.tracks
    ]
    return msgspec.structs.replace(revision, tracks=tracks)


@pytest.mark.parametrize("late", [1, 2, 3])
def test_tracks_exchange_their_keys_once_however_many_late_revisions_report_it(late: int) -> None:
    people = PersonTracker(IdentitySettings(), ["c0"], {"c0": None}, (WIDTH, HEIGHT), 0)
    for epoch in range(4):
        [revision] = people.update(epoch_of(epoch, camera_tracks("c0", epoch, {1: LEFT, 2: RIGHT})))
    left, right = revision.keys
    now = 4 + late
    revisions = tuple(late_revision(epoch) for epoch in range(4, now))
    newest = {"c0": camera_tracks("c0", now, {1: RIGHT, 2: LEFT})}
    for window in people.update(Epoch(now, end_of_epoch(now, STRIDE), newest, late_revisions=revisions)):
        assert window.keys == (right, left), "keys stay on their sides"


@pytest.mark.parametrize("decided_without", [1, 4, 20])
def test_a_camera_that_was_gone_while_it_corrected_its_tracks_still_exchanges_their_keys(
    decided_without: int,
) -> None:
    """Solving a long past again takes long on a busy machine; views are decided without the camera."""
    people = PersonTracker(IdentitySettings(), ["c0"], {"c0": None}, (WIDTH, HEIGHT), 0)
    for epoch in range(4):
        [revision] = people.update(epoch_of(epoch, camera_tracks("c0", epoch, {1: LEFT, 2: RIGHT})))
    left, right = revision.keys
    now = 4 + decided_without
    for epoch in range(4, now):
        people.update(epoch_of(epoch))
        people.forget_before(end_of_epoch(epoch, STRIDE) + 1)
    newest = {"c0": camera_tracks("c0", now, {1: RIGHT, 2: LEFT})}
    last = end_of_epoch(now, STRIDE)
    for window in people.update(Epoch(now, last, newest, late_revisions=(late_revision(4),))):
        assert window.keys == (right, left), "keys stay on their sides"
