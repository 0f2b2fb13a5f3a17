"""Redacted addresses: protocol and host, and nothing that could be a password."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fakes.http.passwords import ADDRESSES, HOST, PASSWORDS, leaks
from server.config.source_address import SourceKind, source_kind
from server.system.address_redaction import cut_at_addresses, redact_to_host, redact_zenoh_endpoint


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ("rtsp://10.0.0.1", "rtsp://10.0.0.1"),
        ("rtsp://10.0.0.1:554/", "rtsp://10.0.0.1:554/"),
        ("rtsp://me:secret@10.0.0.1/live", "rtsp://10.0.0.1/..."),
        ("rtsp://me:secret@[fe80::1]:554", "rtsp://[fe80::1]:554/..."),
        ("rtsp://me:sec@ret@10.0.0.1:554/live", "rtsp://10.0.0.1:554/..."),
        ("rtsp://me:sec ret@10.0.0.1:554/live", "rtsp://10.0.0.1:554/..."),
        ("rtsp://me:sec/ret@10.0.0.1/live", "rtsp://..."),
        ("rtsp://me:sec#ret@10.0.0.1/live", "rtsp://..."),
        ("rtsp://me:sec?ret@10.0.0.1/live", "rtsp://..."),
        ("rtsp://me:s@cr/et@10.0.0.1/live", "rtsp://..."),
        ("rtsp://10.0.0.1/user=me_password=12_34_channel=1", "rtsp://10.0.0.1/..."),
        ("http://camera-1.example/video?p=12", "http://camera-1.example/..."),
        ("async:rtsp://me:secret@10.0.0.1/", "async:..."),
        ("rtsp:me:secret@10.0.0.1/", "rtsp:..."),
        ("me:secret@10.0.0.1/", "(not shown)"),
        ("recordings/key=1.mp4", "recordings/key=1.mp4"),
        ("/recordings/2026-11-22 10:30@hall.mp4", "/recordings/2026-11-22 10:30@hall.mp4"),
        ("/etc/myview/smb:/me:secret@nas/kept", "/etc/myview/..."),
        ("hall:1.mp4", "hall:1.mp4"),
        ("/dev/v4l/by-path/pci-0000:00:14.0-usb", "/dev/v4l/by-path/pci-0000:00:14.0-usb"),
        ("scene:room?camera=0&seed=1", "scene:room?camera=0&seed=1"),
    ],
)
def test_only_protocol_and_host_of_addresses_are_shown_and_paths_are_unchanged(
    address: str, expected: str
) -> None:
    assert redact_to_host(address) == expected
    assert redact_to_host(expected) == expected, "redaction is idempotent"


@given(st.sampled_from(ADDRESSES), PASSWORDS)
@example(ADDRESSES[0], "ps/w")
@example(ADDRESSES[0], "pa@q/xz")
def test_no_part_of_a_password_is_shown(place: str, password: str) -> None:
    redacted = redact_to_host(place.format(password))
    assert not leaks(redacted, password, without=place), redacted
    assert redact_to_host(redacted) == redacted


@given(PASSWORDS.filter(lambda password: not set(password) & set("/?#")))
def test_the_host_is_shown_if_it_is_unambiguous(password: str) -> None:
    assert redact_to_host(f"rtsp://user:{password}@{HOST}:554/live") == f"rtsp://{HOST}:554/..."


@given(st.text())
def test_any_text_can_be_redacted(text: str) -> None:
    assert isinstance(redact_to_host(text) + redact_zenoh_endpoint(text), str)


@pytest.mark.parametrize(
    "source", ["rtsp:me:secret@10.0.0.1/", "concat:a|b", "srt://10.0.0.1:9", "/dev/video7"]
)
def test_sources_that_ffmpeg_opens_by_protocol_are_not_files(source: str) -> None:
    assert source_kind(source) is SourceKind.STREAM


@pytest.mark.parametrize(
    ("endpoint", "expected"),
    [
        ("tcp/127.0.0.1:7447", "tcp/127.0.0.1:7447"),
        ("tls/[::1]:7447", "tls/[::1]:7447"),
        ("tls/bus.example:7447#connect_private_key_base64=c2VjcmV0", "tls/bus.example:7447 ..."),
        ("tls/bus#key=c2VjcmV0:7447", "(not shown)"),
        ("tls/me:secret@bus:7447", "(not shown)"),
    ],
)
def test_options_of_bus_endpoints_are_hidden(endpoint: str, expected: str) -> None:
    assert redact_zenoh_endpoint(endpoint) == expected


@given(
    st.sampled_from([address for address in ADDRESSES if not address.startswith(("rtsp//", "user:"))]),
    PASSWORDS,
)
def test_texts_are_cut_where_an_address_begins(place: str, password: str) -> None:
    text = f"Traceback\n  File a.py, line 3\nOSError: [Errno 5] Failed: '{place.format(password)}'\nmore\n"
    redacted = cut_at_addresses(text)
    assert not leaks(
        redacted, password, without=f"{place}{text.partition('Failed')[0]}Failed: '...\nmore\n"
    ), redacted
    assert redacted.startswith("Traceback\n  File a.py, line 3\nOSError: [Errno 5] Failed: ")
    assert redacted.endswith("\nmore\n")
