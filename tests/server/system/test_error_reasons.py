"""Why something failed, in one line."""

from __future__ import annotations

import asyncio
import errno
import os
import socket
from pathlib import Path

import av
import pytest

from server.system.address_redaction import located_reason_of
from server.system.errors import UserError, reason_of

MISSING = os.strerror(errno.ENOENT)


def raised_by(path: Path) -> OSError:
    with pytest.raises(OSError, match="missing") as caught:
        path.read_bytes()
    return caught.value


def test_the_systems_words_are_the_reason_and_the_file_is_named_where_asked_for(tmp_path: Path) -> None:
    error = raised_by(tmp_path / "missing")
    assert reason_of(error) == reason_of(error, "it is not text") == MISSING
    assert located_reason_of(error) == f"{tmp_path}/missing: {MISSING}"


def test_an_address_is_not_repeated() -> None:
    error = FileNotFoundError(errno.ENOENT, MISSING, "rtsp://user:secret@10.0.0.1/live")
    assert located_reason_of(error) == f"rtsp://10.0.0.1/...: {MISSING}"


def test_errors_without_the_systems_words_have_their_text_in_one_line_or_another() -> None:
    assert reason_of(OSError("the disk\n  is gone")) == located_reason_of(OSError("the disk is gone"))
    assert (
        reason_of(UnicodeDecodeError("utf-8", b"secret\xff", 6, 7, "no"), "it is not text")
        == "it is not text"
    )
    assert reason_of(TimeoutError()) == "TimeoutError"


def test_a_file_in_another_encoding_is_said_to_be_so(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    path.write_bytes("site: {name: hällo}".encode("latin-1"))
    with pytest.raises(UnicodeDecodeError) as caught:
        path.read_text(encoding="utf-8")
    assert reason_of(caught.value) == "it is not UTF-8 text"


async def test_a_port_in_use_is_told_in_the_systems_words_without_the_address() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(OSError, match="in use") as caught:
        await asyncio.start_server(lambda *_: None, *taken.getsockname())
    assert reason_of(caught.value) == os.strerror(errno.EADDRINUSE)


def test_ffmpegs_words_are_a_reason(tmp_path: Path) -> None:
    (tmp_path / "a.mp4").write_bytes(b"no video")
    with pytest.raises(av.error.FFmpegError) as caught:
        av.open(str(tmp_path / "a.mp4"))
    assert reason_of(caught.value) == "Invalid data found when processing input"


def test_a_users_error_is_its_text_and_a_bug_shows_what_it_is() -> None:
    assert located_reason_of(UserError("a.yaml: wrong")) == "a.yaml: wrong"
    assert located_reason_of(KeyError("c9")) == "KeyError('c9')"
