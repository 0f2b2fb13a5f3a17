"""Addresses of cameras: the password is kept apart, and only cameras are accepted."""

from __future__ import annotations

from urllib.parse import unquote, urlsplit

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.setup.camera_address import free_name, parse_address
from server.system.errors import UserError

LOGIN = st.text(
    st.characters(min_codepoint=33, max_codepoint=0x2FF, categories=["L", "N", "P", "S"]), max_size=20
)


def test_a_login_beside_the_address_goes_into_the_source_and_its_password_apart() -> None:
    address = parse_address("rtsp://10.0.0.11:8554/live?x=1", "viewer", "p@ss/word")
    assert address.source == "rtsp://viewer:{password}@10.0.0.11:8554/live?x=1"
    opened = "rtsp://viewer:p%40ss%2Fword@10.0.0.11:8554/live?x=1"
    assert address.with_password == opened
    assert address.options == {"rtsp_transport": "tcp"}
    assert "p@ss" not in repr(address) + address.shown


def test_a_login_in_the_address_is_taken_apart() -> None:
    address = parse_address("rtsp://viewer:s%20cret@[fe80::1]/live")
    assert (address.source, address.password) == ("rtsp://viewer:{password}@[fe80::1]/live", "s cret")


@given(LOGIN, LOGIN)
def test_every_login_reaches_the_camera_unchanged(user: str, password: str) -> None:
    opened = urlsplit(parse_address("rtsp://10.0.0.11/live", user, password).with_password)
    assert opened.hostname == "10.0.0.11"
    assert unquote(opened.username or "") == user
    assert unquote(opened.password or "") == password


@pytest.mark.parametrize(
    "text",
    ["", "10.0.0.11", "/etc/passwd", "file:///etc/passwd", "concat:a|b", "rtsp://", "rtsp://h:99999/", "ftp://h/",
     "rtsp://h/a b", "/dev/sda", "/dev/video0/../sda", "x" * 2000, "rtsp://[", "http://h/\n"],
)  # fmt: skip
def test_what_is_no_camera_is_refused_with_examples(text: str) -> None:
    with pytest.raises(UserError, match="such as rtsp://10") as refused:
        parse_address(text + "" if text.strip() == text else text + "x")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("rtsp://admin:p@ss:w/rd#?%@10.0.0.11/live", "its password has a character that ends the login"),
        ("rtsp://admin:123#4@10.0.0.11/", "its password has a character that ends the login"),
        ("rtsp://admin:12/3@10.0.0.11/live", "its password has a character that ends the login"),
        ("rtsp://admin:s3 cret@10.0.0.11/live", "its password has a character that ends the login"),
        ("rtsp://10.0.0.11/my stream", "it has a space or an invisible character: write %20"),
        ("rtsp://10.0.0.11/live\u200b", "it has a space or an invisible character: write %20"),
        ("rtsp://fe80::1/live", "an IPv6 address stands in brackets"),
        ("rtsp://viewer:pass@2001:db8::12/live", "an IPv6 address stands in brackets"),
        ("rtsp://::1", "an IPv6 address stands in brackets"),
    ],
)
def test_what_is_wrong_with_an_address_is_said_without_its_password(text: str, error: str) -> None:
    with pytest.raises(UserError, match=error) as refused:
        parse_address(text)
    for secret in ("ss:w", "123", "12/3", "s3 cret", "pass@"):
        assert secret not in str(refused.value)


@pytest.mark.parametrize(
    "text", ["rtsp://10.0.0.11:554/user@home", "rtsp://u:p@10.0.0.11/x?mail=a@b", "rtsp://[::1]:554/a@b"]
)
def test_an_at_sign_in_the_path_belongs_to_it(text: str) -> None:
    assert parse_address(text).with_password == text


@given(st.text(max_size=60), st.text(max_size=10), st.text(max_size=10))
def test_any_text_is_accepted_or_refused_in_one_line(text: str, user: str, password: str) -> None:
    refused = ""
    try:
        parse_address(text, user, password)
    except UserError as error:
        refused = str(error)
    assert len(refused.splitlines()) <= 1


@pytest.mark.parametrize(
    ("wanted", "name"),
    [
        ("Front door!", "Front-door"),
        ("", "camera-1"),
        ("bestview", "camera-1"),
        ("bestview-2", "camera-1"),
        ("c0", "c0-1"),
        ("ß", "camera-1"),
    ],
)
def test_a_name_is_made_from_what_a_camera_calls_itself(wanted: str, name: str) -> None:
    assert free_name(wanted, {"c0"}) == name
