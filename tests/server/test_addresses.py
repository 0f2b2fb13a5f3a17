"""Addresses as they may be shown."""

from __future__ import annotations

import pytest

from server.wire.addresses import shown


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ("rtsp://me:secret@10.0.0.1/live", "rtsp://(not shown)@10.0.0.1/live"),
        ("rtsp://10.0.0.1/user=me_password=12_34_channel=1", "rtsp://10.0.0.1/user=me_password=(not shown)"),
        ("http://10.0.0.1/video?usr=me&pwd=12&size=1", "http://10.0.0.1/video?usr=me&pwd=(not shown)&size=1"),
        ("http://10.0.0.1/video?usr=me&pw=12&size=1", "http://10.0.0.1/video?usr=me&pw=(not shown)&size=1"),
        ("http://10.0.0.1/video?Token=ab", "http://10.0.0.1/video?Token=(not shown)"),
        ("http://10.0.0.1/video?mpw=3&up=1", "http://10.0.0.1/video?mpw=3&up=1"),
        ("recordings/key=1.mp4", "recordings/key=1.mp4"),
    ],
)
def test_what_a_camera_wants_to_hear_is_not_shown(address: str, expected: str) -> None:
    assert shown(address) == expected
