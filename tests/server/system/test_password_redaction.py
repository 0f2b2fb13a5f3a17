"""No output of MyView has a camera's password."""

from __future__ import annotations

import json
import logging
import sys
import traceback
from pathlib import Path
from typing import Any

import av
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from fakes.cli.command_line import RunCommand
from fakes.http.passwords import ADDRESSES, PASSWORDS, leaks
from fakes.system.ports import free_port
from server.camera.audio import open_site_audio
from server.camera.passthrough.opening import open_passthrough
from server.camera.sources import open_source
from server.config import yaml_file
from server.config.loader import build_config
from server.config.sections import CameraSettings, SiteSettings
from server.config.site_config import Config
from server.config.yaml_file import read_yaml
from server.http.operator.settings import settings_of
from server.system.errors import UserError
from server.system.log_format import JsonLines, RedactingFormatter

HARMLESS = "0000"
NAIVE = ("QXZ/JKV7", "QXZ JKV7", "QXZ@JKV7", "QXZ#JKV7", "QXZ?JKV7", "QXZJKV7")
"""A careless parser ends the address at one of these. The users below are hosts of this machine, because
FFmpeg parses like this and would look up others."""
SOURCES = (
    "rtsp://127.0.0.1:{}@127.0.0.1:1/x",
    "rtsp://127.0.0.1:1/x/{}",
    "http://127.0.0.1:1/x?p={}",
    "http://127.0.0.1:1/x?credentials={}",
    "http://127.0.0.1:1/x?sig={}",
    "async:rtsp://127.0.0.1:{}@127.0.0.1:1/x",
    "concat:rtsp://127.0.0.1:{}@127.0.0.1:1/x",
    "nonsense://127.0.0.1:{}@127.0.0.1:1/x",
    "rtsp:127.0.0.1:{}@127.0.0.1:1/x",
    "rtsp//127.0.0.1:{}@127.0.0.1:1/x",
)
"""Sources that do not answer, have an unknown protocol, or are not addresses."""


def built(**changes: Any) -> Config:
    content = {"cameras": [{"id": "door", "source": "door.mp4"}], **changes}
    return build_config(content, where="site.yaml", folder=Path("/etc/myview"))


def written(config: Config) -> str:
    """Return all texts that an operator sees of a configuration."""
    return "\n".join(f"{setting.key}: {setting.value} {setting.default}" for setting in settings_of(config))


def door(source: str, **changes: Any) -> dict[str, Any]:
    return {"id": "door", "source": source, **changes}


@settings(max_examples=30)  # each writes out all settings
@given(st.sampled_from(ADDRESSES), PASSWORDS)
def test_the_operators_page_shows_no_password_of_a_source(place: str, password: str) -> None:
    def errors_of(secret: str) -> str:
        source = place.format(secret)
        return written(built(cameras=[door(source)], sound={"source": source}))

    assert not leaks(errors_of(password), password, without=errors_of(HARMLESS))


@settings(max_examples=20)
@given(PASSWORDS.filter(lambda password: not set(password) & set(" /#?,")))
def test_the_operators_page_shows_no_other_secrets(password: str) -> None:
    def errors_of(secret: str) -> str:
        options = {"headers": f"Authorization: Basic {secret}", "rtsp_transport": secret}
        file = f"{secret}.password"  # the password itself instead of a file
        cameras = [door("rtsp://viewer:{password}@192.0.2.11/", options=options, password=file)]
        servers = [f"http://viewer:{secret}@192.0.2.11/"]
        zenoh = {"connect": f"tls/bus:7447#key={secret}"}
        record = {"folder": f"smb://me:{secret}@nas/kept"}
        return written(
            built(cameras=cameras, zenoh=zenoh, record=record, view={"sharding": {"servers": servers}})
        )

    assert not leaks(errors_of(password), password, without=errors_of(HARMLESS))


def misplaced(address: str, secret: str) -> list[dict[str, Any]]:
    """Return configurations with an address or a secret in a wrong place."""
    camera = door("door.mp4")
    return [
        {"cameras": [{**camera, address: None}]},
        {"cameras": [{**camera, "id": address}]},
        {"cameras": [{**camera, "at_end": address}]},
        {"cameras": [{**camera, "kind": address}]},
        {"cameras": [{**camera, "ground": address}]},
        {"cameras": [{**camera, "options": {"headers": f"Cookie: {secret}\r\n"}}]},
        {"cameras": [{**camera, "options": {"headers": [secret]}}]},
        {"cameras": [{**camera, "source": f"{address}\n"}]},
        {"cameras": [{**camera, "source": f"{address}\ud800"}]},
        {"cameras": [{**camera, "source": [address]}]},
        {"cameras": [{**camera, "source": address, "substream": address}]},
        {"cameras": [{**camera, "substream": f"{address}\n"}]},
        {"cameras": address},
        {"cameras": [address]},
        {address: None, "cameras": [camera]},
        {"cameras": [camera], "zenoh": {"connect": address}},
        {"cameras": [camera], "zenoh": {"listen": f"tls/bus#key={secret}"}},
        {"cameras": [camera], "view": {"sharding": {"servers": [f"{address} "]}}},
    ]


@settings(max_examples=30)
@given(st.sampled_from(ADDRESSES), PASSWORDS)
def test_no_configuration_error_repeats_a_password(place: str, password: str) -> None:
    address = place.format(password)
    secrets = zip(misplaced(address, password), misplaced(place.format(HARMLESS), HARMLESS), strict=True)
    for content, harmless in secrets:
        errors_of = []
        for mapping in (content, harmless):
            with pytest.raises(UserError) as refused:
                build_config(mapping, where="site.yaml", folder=Path())
            errors_of.append("".join(traceback.format_exception(refused.value.__cause__ or refused.value)))
            errors_of[-1] += str(refused.value)
        assert not leaks(errors_of[0], password, without=errors_of[1]), errors_of[0]


@pytest.mark.parametrize(
    "text",
    [
        "source: [rtsp://me:QXZJKV7@h/\n",
        "source: rtsp://me:QXZJKV7@h: x\n",
        "source: *QXZJKV7\n",
        "source: !QXZJKV7 x\n",
        "source: !QXZJ!KV7 x\n",
        "source: @QXZJKV7\n",
        'source: "QXZJKV7\\q"\n',
        "&QXZJKV7 a: b\n&QXZJKV7 c: d\n",
        "source: !!int QXZJKV7\n",
        "rtsp://me:QXZJKV7@h/ : 1\nrtsp://me:QXZJKV7@h/ : 2\n",
    ],
)
@pytest.mark.parametrize("loader", ["with libyaml", "without libyaml"])
def test_yaml_errors_do_not_repeat_the_content(
    text: str, loader: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if loader == "without libyaml":

        class Plain(yaml.SafeLoader):
            pass

        monkeypatch.setattr(yaml_file, "_Loader", Plain)
        monkeypatch.setattr(yaml_file, "SafeLoader", yaml.SafeLoader)
    path = tmp_path / "site.yaml"
    path.write_text(text)
    with pytest.raises(UserError, match=r"site\.yaml: ") as refused:
        read_yaml(path, "the configuration")
    shown_text = "".join(traceback.format_exception(refused.value))
    assert not leaks(shown_text, "QXZJKV7", without="")


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("password", NAIVE)
def test_errors_of_opening_a_camera_do_not_have_its_password(source: str, password: str) -> None:
    address = source.format(password)
    config = built(cameras=[door(address, passthrough="auto")], sound={"source": address})
    for attempt in (
        lambda: open_source(CameraSettings(id="door", source=address), SiteSettings()),
        lambda: open_passthrough(config, config.camera("door"), None),
        lambda: open_site_audio(config, "door"),
    ):
        with pytest.raises(UserError) as refused:
            attempt()
        shown_text = "".join(traceback.format_exception(refused.value))
        assert not leaks(shown_text, password, without=""), shown_text


def test_the_doctor_shows_no_password(myview: RunCommand, tmp_path: Path) -> None:
    cameras = [
        {"id": f"c{number}", "source": source.format(NAIVE[number % len(NAIVE)])}
        for number, source in enumerate(SOURCES)
    ]
    cameras[0]["options"] = {"headers": "Authorization: Basic QXZJKV7"}
    content = {
        "cameras": cameras,
        "sound": {"source": "http://127.0.0.1:QXZ/JKV7@127.0.0.1:1/a.aac"},
        **{section: {"port": free_port()} for section in ("sync", "http")},
        "zenoh": dict.fromkeys(("connect", "listen"), f"tcp/127.0.0.1:{free_port()}"),
    }
    path = tmp_path / "site.yaml"
    path.write_text(yaml.safe_dump(content))
    for how in ([], ["--json"]):
        result = myview("doctor", path, "--seconds", 1, *how)
        assert result.code == 1
        for password in NAIVE:
            assert not leaks(result.out + result.err, password, without="")
    shown_text = {load["check"]: load["text"] for load in json.loads(result.out)["findings"]}
    assert shown_text["camera c1"].startswith("rtsp://127.0.0.1:1/...: cannot open this video: ")
    assert shown_text["camera c9"] == "(not shown): no such file or folder"


@pytest.mark.parametrize("command", ["render", "track", "calibrate"])
def test_an_address_given_as_a_recording_is_not_repeated(
    command: str, myview: RunCommand, tmp_path: Path
) -> None:
    for password in NAIVE:
        result = myview(command, f"rtsp://127.0.0.1:{password}@127.0.0.1:1/x", "--out", tmp_path / "out")
        assert result.code == 2
        assert not leaks(result.out + result.err, password, without="")


@pytest.mark.parametrize("lines", [RedactingFormatter(), JsonLines("door")])
@pytest.mark.parametrize("password", NAIVE)
def test_logged_tracebacks_are_cut_where_an_address_begins(lines: logging.Formatter, password: str) -> None:
    try:
        av.open(f"rtsp://127.0.0.1:{password}@127.0.0.1:1/x", timeout=(5.0, 5.0))
    except (av.error.FFmpegError, OSError):
        record = logging.LogRecord("server", logging.ERROR, __file__, 1, "it failed", (), sys.exc_info())
        shown_text = lines.format(record)
    assert "it failed" in shown_text
    assert "Traceback" in shown_text
    assert not leaks(shown_text, password, without="")
