"""Targets for configurations: as text, as values, from the environment; and an operator's trial settings."""

from __future__ import annotations

import json
import os
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import patch

import msgspec
from pydantic import TypeAdapter

from benchmarks.fuzz.engine.fed_site import site
from benchmarks.fuzz.engine.mutations import as_json, mutate_bytes, mutate_value, odd
from benchmarks.fuzz.engine.target import Target, folder, refused
from server.config.loader import build_config, change_view_settings, load_config
from server.config.site_config import Config
from server.config.tokens_file import read_tokens
from server.http.operator.settings import settings_of
from server.service.pipeline import BestViewPipeline
from server.system.errors import UserError

WORDS = (
    b":", b": ", b"- ", b"\n", b"\n  ", b"\t", b"\x00", b"\xff", b"&a ", b"*a", b"!!int ''", b"!!float ''",
    b"!!bool x", b"!!timestamp x", b"!!set ", b"!!binary =", b"!!python/object:os.system x", b"<<: *a\n",
    b"? ", b"| ", b"> ", b"%YAML 9.9\n", b"---\n", b"...\n", b"0b_", b"0x", b"1:2", b"190:20:30", b".inf",
    b"-.inf", b".nan", b"1e999", b"9" * 40, b"9" * 5000, b"[" * 500, b"{" * 500, b"- " * 500, b"null",
    b"~", b"2001-99-99", b"'", b'"', b"#", b"\\ud800", b"\xe2\x80\xa8",
)  # fmt: skip
_PLAIN = b"""site: {name: hall, fps: 25}
cameras:
  - id: c0
    source: c0.mp4
    ignore: [[[0, 0], [9, 0], [9, 9]]]
  - {id: c1, source: "rtsp://10.0.0.2/a", offset_s: 0.1}
track: {window: {stride: 5}}
view: {lookahead_s: 1, identity: {confirmation_s: 0.08}}
http: {port: 8080}
"""
_TOKENS = b"""tokens:
  - {name: hall, sha256: %b, role: watch, object: 3, made: 2026-11-21T16:13:36Z}
  - name: Ada
    sha256: "%b"
    role: operate
""" % (b"a1" * 32, b"0f" * 32)
_VARIABLE = "MYVIEW_"
_MAX_CAMERAS = 20
_WHOLE_SHARE = 1 / 16
"""Share of inputs with whole sections, which take longest to parse."""
_DESCRIBE_EVERY = 256
"""One configuration in so many is also described, which takes longer than parsing."""


class _IsolatedConfig(Target):
    """A target that reads configurations without the machine's environment variables."""

    def __init__(self) -> None:
        self._environment = patch.dict(os.environ, clear=True)

    def hand_over(self, data: bytes) -> bool:
        """Feed an input, and restore the environment."""
        with self._environment:
            return super().hand_over(data)


def _use(config: Config, *, describe: bool) -> None:
    """Use a configuration as every process does."""
    if describe:
        for setting in settings_of(config):
            msgspec.json.encode(setting)
    if len(config.cameras) <= _MAX_CAMERAS:
        BestViewPipeline(config)


class ConfigFile(_IsolatedConfig):
    """Target for a configuration file."""

    name = "config-text"

    def __init__(self) -> None:
        super().__init__()
        self._folder = folder()
        self._path = Path(self._folder.name) / "site.yaml"

    def make(self, rng: Random) -> bytes:
        """Return a file."""
        return mutate_bytes(rng, _PLAIN, WORDS) if rng.random() < 0.99 else _PLAIN

    def feed(self, data: bytes) -> bool:
        """Load it."""
        self._path.write_bytes(data)
        try:
            config = load_config(self._path)
        except UserError as error:
            return refused(error)
        _use(config, describe=len(data) % _DESCRIBE_EVERY == 0)
        return True

    def close(self) -> None:
        """Remove the folder."""
        self._folder.cleanup()


class TokenStore(Target):
    """Target for the file of access tokens."""

    name = "config-tokens"

    def __init__(self) -> None:
        self._folder = folder()
        self._path = Path(self._folder.name) / "tokens.yaml"

    def make(self, rng: Random) -> bytes:
        """Return a file."""
        return mutate_bytes(rng, _TOKENS, WORDS) if rng.random() < 0.99 else _TOKENS

    def feed(self, data: bytes) -> bool:
        """Read it."""
        self._path.write_bytes(data)
        try:
            read_tokens(self._path)
        except UserError as error:
            return refused(error)
        return True

    def close(self) -> None:
        """Remove the folder."""
        self._folder.cleanup()


class ConfigValues(_IsolatedConfig):
    """Target for configuration values: sections with one changed value, also from the environment."""

    name = "config-values"

    def __init__(self) -> None:
        super().__init__()
        sections = {name: _plain(value) for name, value in site() if name != "ground"}
        self._cameras = sections.pop("cameras")
        self._sections: dict[str, Any] = sections

    def make(self, rng: Random) -> bytes:
        """Return sections, and environment variables."""
        names, whole = rng.sample(sorted(self._sections), 2), rng.random() < _WHOLE_SHARE
        content: Any = {name: self._sections[name] for name in names} | {"cameras": self._cameras}
        if not whole:
            sections = {name: _some_keys(rng, content[name]) for name in names}
            content = sections | {
                "cameras": [_some_keys(rng, camera, ("id", "source")) for camera in self._cameras]
            }
        variables: dict[str, str] = {}
        if rng.random() < 0.1:
            section = rng.choice(names)
            inner = self._sections[section]
            key = rng.choice(list(inner)) if isinstance(inner, dict) else ""
            value = odd(rng)
            text = as_json(value).decode() if rng.random() < 0.5 else str(value)
            variables[f"{section}__{key}".upper() if key else section.upper()] = text.replace("\x00", "")
        else:
            content = mutate_value(rng, content)
        return as_json([content, variables])

    def feed(self, data: bytes) -> bool:
        """Build the configuration."""
        content, variables = json.loads(data)
        if not isinstance(content, dict):
            content = {}
        content = {str(key): value for key, value in content.items()}
        environment = {
            _VARIABLE + name: value.encode("utf-8", "replace").decode() for name, value in variables.items()
        }
        os.environ.update(environment)
        try:
            config = build_config(content, where="site.yaml", folder=Path())
            _use(config, describe=len(data) % _DESCRIBE_EVERY == 0)
        except UserError as error:
            return refused(error)
        finally:
            for name in environment:
                del os.environ[name]
        return True


class TrialSettings(Target):
    """Target for an operator's trial settings of view selection."""

    name = "config-preview"

    def __init__(self) -> None:
        self._service = BestViewPipeline(site())
        self._view = self._service.decider.view

    def make(self, rng: Random) -> bytes:
        """Return changes to some settings."""
        changes = {
            "switch_cost_s": 0.3,
            "extrapolate_s": 0.5,
            "presence_decay_s": 1.0,
            "undetected_weight": 1.0,
            "min_shot_s": 0.0,
            "quality": {"relative": 1.0},
        }
        return as_json(mutate_value(rng, changes))

    def feed(self, data: bytes) -> bool:
        """Select views with the settings."""
        changes = json.loads(data)
        if not isinstance(changes, dict):
            return False
        try:
            view = change_view_settings(self._view, changes, "to try out")
        except UserError as error:
            return refused(error)
        self._service.decider.apply_live_view_settings(view)
        return True


def _some_keys(rng: Random, section: Any, needed: tuple[str, ...] = ()) -> Any:
    """Return some keys of a section, including the required ones."""
    if not isinstance(section, dict):
        return section
    names = {*needed, *rng.sample(list(section), min(len(section), rng.randrange(1, 5)))}
    return {name: value for name, value in section.items() if name in names}


def _plain(value: Any) -> Any:
    """Return a section as YAML types."""
    return json.loads(TypeAdapter(Any).dump_json(value))


TARGETS = (ConfigFile, TokenStore, ConfigValues, TrialSettings)
