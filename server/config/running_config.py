"""The active configuration of a process, compared with its file, which may have changed since."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import yaml

from server.config.config_diff import changed_keys
from server.config.loader import build_config, read_content
from server.config.site_config import Config
from server.system.errors import UserError
from server.system.file_state import FileState, file_state
from server.system.private_files import is_owned_by_this_user

ACTIVE_CONFIG_VARIABLE = "MYVIEW_IN_FORCE"
"""Environment variable with the path of the active configuration, set by `myview up` for its processes.

A restarted process must not use a changed configuration file that was not reloaded yet.
"""


@dataclass(frozen=True, slots=True)
class ConfigFileState:
    """The difference between the configuration file and the active configuration."""

    error: str
    """Why the file is invalid; empty: it is valid."""
    changed_keys: tuple[str, ...]
    """Keys of the settings that differ."""

    @property
    def differs(self) -> bool:
        """Whether the file differs from the active configuration."""
        return bool(self.error or self.changed_keys)


class ActiveConfig:
    """The active configuration, ``now``; the process replaces it after a reload.

    Raises:
        UserError: the file cannot be read or is invalid.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.now = self.read_config_to_activate()
        self._seen: tuple[FileState | None, ...] = ()
        self._file: Config | UserError = self.now

    def read_config_to_activate(self) -> Config:
        """Read the configuration to activate: the supervisor's active one if there is one, else the file.

        Raises:
            UserError: it cannot be read or is invalid.
        """
        active_file = os.environ.get(ACTIVE_CONFIG_VARIABLE)
        if active_file is None or not is_owned_by_this_user(Path(active_file)):
            return self._read_file()
        return build_config(read_content(Path(active_file)), where=str(self.path), folder=self.path.parent)

    def on_disk(self) -> ConfigFileState:
        """Compare the file with the active configuration; it is read again only when it has changed.

        An invalid file is read each time, since the error may be in a file that it names.
        """
        folder = self.path.parent
        ground = self._file.ground if isinstance(self._file, Config) else None
        seen = (file_state(self.path), None if ground is None else file_state(folder / ground))
        if seen != self._seen or isinstance(self._file, UserError):
            self._seen = seen
            try:
                self._file = self._read_file()
            except UserError as error:
                self._file = error
        if isinstance(self._file, UserError):
            return ConfigFileState(str(self._file), ())
        return ConfigFileState("", changed_keys(self.now, self._file))

    def _read_file(self) -> Config:
        """Read the file, with absolute paths: those of the supervisor's active configuration are."""
        content = read_content(self.path)
        return build_config(content, where=str(self.path), folder=self.path.parent.absolute())


def serialize_with_absolute_paths(config: Config, folder: Path) -> str:
    """Return a configuration as YAML with absolute paths; ``folder`` is that of its file."""
    content = config.model_dump(mode="json", exclude={"ground"})  # each camera has its homography
    absolute = build_config(content, where="the configuration in force", folder=folder.absolute())
    return yaml.safe_dump(absolute.model_dump(mode="json", exclude={"ground"}), sort_keys=False)
