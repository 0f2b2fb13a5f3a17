"""What an RTSP request asks for: the stream by its path, the token by Basic authentication."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fakes.rtsp.gateway import basic
from server.rtsp.request import mount_of, stream_address


@pytest.mark.parametrize(
    ("path", "stream"),
    [
        ("/objects/3", "/objects/3/best.mp4"),
        ("/objects/3/", "/objects/3/best.mp4"),
        ("/objects/3/stream=0", "/objects/3/best.mp4"),
        ("/cameras/c1/stream=1", "/cameras/c1/live.mp4"),
        ("/objects/x", None),
        ("/objects/3/best.mp4", None),
        ("/cameras/../objects/3", None),
        ("/cameras/c1?token=x", None),
        ("", None),
    ],
)
def test_a_path_means_a_stream_of_the_service(path: str, stream: str | None) -> None:
    address = stream_address(mount_of(path), None)
    assert (None if address is None else address.path) == stream


@pytest.mark.parametrize(
    ("authorization", "token"),
    [
        (None, None),
        (basic("any", "secret"), "secret"),
        (basic("secret", ""), "secret"),
        (basic("any", "a:b"), "a:b"),
        (basic("", ""), None),
        ("Basic §", None),
        ("Basic " + "A" * 5000, None),
        ("Bearer secret", None),
        ("Digest username=x", None),
    ],
)
def test_the_token_is_the_password_or_the_name_alone(authorization: str | None, token: str | None) -> None:
    address = stream_address("/objects/1", authorization)
    assert address is not None
    assert address.token == token
    assert token is None or token not in repr(address)


@given(st.text(max_size=60), st.text(max_size=60))
def test_any_request_has_an_answer(path: str, authorization: str) -> None:
    stream_address(mount_of(path), authorization)
    stream_address("/objects/1", f"Basic {authorization}")
