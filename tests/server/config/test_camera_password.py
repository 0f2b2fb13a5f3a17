"""Camera passwords from files that only the camera's process reads."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.config.camera_password import fill_in_password
from server.config.loader import build_config
from server.config.site_config import Config
from server.system.errors import UserError

SOURCE = "rtsp://viewer:{password}@192.0.2.11/stream1"


def config_of(folder: Path, source: str = SOURCE) -> Config:
    cameras = [
        {"id": "door", "source": source, "substream": f"{source}/small", "password": "door.password"},
        {"id": "stairs", "source": "rtsp://192.0.2.12/"},
    ]
    return build_config({"cameras": cameras}, where="site.yaml", folder=folder)


@given(st.text(st.characters(codec="utf-8", exclude_categories=["C", "Z"]), min_size=1))
def test_any_password_is_passed_unchanged(tmp_path_factory: pytest.TempPathFactory, password: str) -> None:
    folder = tmp_path_factory.mktemp("site")
    (folder / "door.password").write_text(password + "\n", encoding="utf-8")
    filled = fill_in_password(config_of(folder), "door").camera("door")
    address = urlsplit(filled.source)
    assert unquote(address.password or "") == password
    assert (address.username, address.hostname, address.path) == ("viewer", "192.0.2.11", "/stream1")
    assert filled.substream == f"{filled.source}/small"


def test_other_processes_do_not_need_the_password_file(tmp_path: Path) -> None:
    config = config_of(tmp_path)
    assert config.camera("door").source == SOURCE
    assert fill_in_password(config, "stairs") == config


@pytest.mark.parametrize("content", [b"", b"\n", b"two\nlines\n", b"\xff\xfe", None])
def test_an_invalid_password_file_is_refused_with_one_line(tmp_path: Path, content: bytes | None) -> None:
    if content is not None:
        (tmp_path / "door.password").write_bytes(content)
    with pytest.raises(UserError, match=r"^cameras\.door\.password: the file ") as refused:
        fill_in_password(config_of(tmp_path), "door")
    assert "\n" not in str(refused.value)


def test_a_password_without_a_placeholder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"cameras\.0\.password: names a file"):
        config_of(tmp_path, "rtsp://viewer@192.0.2.11/")
