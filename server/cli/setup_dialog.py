"""``myview init``: sets a site up in the terminal, and writes its configuration."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from pathlib import Path

import typer

from server.setup.camera_address import free_name, parse_addresses
from server.setup.discovery import FoundCamera
from server.setup.onvif_profiles import INSTALL, is_installed
from server.setup.proposal import SiteProposal
from server.setup.session import SetupSession, TriedCamera
from server.setup.stream_pair import propose_pair
from server.setup.trial_messages import StreamProfile
from server.system.errors import UserError

_NO_USER = "-"


def run_setup_dialog(path: Path, search_s: float) -> None:
    """Ask for everything, and write the configuration; ``search_s`` 0 searches for no cameras.

    Raises:
        UserError: the answers end too early, there is no camera, or the file cannot be written.
    """
    if not path.parent.is_dir():
        raise UserError(f"{path.parent}: no such folder")
    try:
        with asyncio.Runner() as runner:
            SetupDialog(SetupSession(path), runner).run(search_s)
    except typer.Abort as error:
        if isinstance(error.__context__, KeyboardInterrupt):
            raise KeyboardInterrupt from None
        raise UserError("init: the answers ended before the site was set up; nothing was written") from None


class SetupDialog:
    """Questions and answers in a terminal."""

    def __init__(self, session: SetupSession, runner: asyncio.Runner) -> None:
        self._session, self._runner = session, runner
        self._user = self._password = ""
        """The last login, proposed for the next camera."""

    def run(self, search_s: float) -> None:
        """Ask for everything, and write the configuration.

        Raises:
            UserError: there is no camera, or the file cannot be written.
        """
        if search_s:
            typer.echo("Searching for cameras …")
            found = self._search(search_s)
            typer.echo(f"{len(found)} found." if found else "None found by ONVIF.")
            if found and not is_installed():
                typer.echo(INSTALL)
            for camera in found:
                self._offer(camera)
        while self._ask_address():
            pass
        self._write()

    def _search(self, seconds: float) -> Sequence[FoundCamera]:
        try:
            return self._runner.run(self._session.discover(seconds))
        except UserError as error:
            typer.echo(str(error))
            return ()

    def _offer(self, found: FoundCamera) -> None:
        label = " ".join(
            filter(None, (found.host, found.name, f"({found.hardware})" if found.hardware else ""))
        )
        if not typer.confirm(f"Add {label}?", default=True):
            return
        if not is_installed():
            self._ask_address(f"Address of {label} (empty: none)")
            return
        while True:
            login = self._ask_login()
            answer, keys = self._runner.run(self._session.profiles(found.host, found.port, *login))
            if not answer.error:
                break
            typer.echo(f"{found.host}: {answer.error}")
            if not answer.needs_password or not typer.confirm("Try again?", default=True):
                return
        for number, profile in enumerate(answer.profiles, 1):
            typer.echo(f"  {number}  {profile.name}: {profile.codec} {profile.width}x{profile.height}")
        source, substream = self._ask_streams(answer.profiles)
        try:
            typer.echo("Trying …")
            small = None if substream is None else keys[substream]
            self._take(
                self._runner.run(self._session.add(self._session.offered(keys[source], small), found.name))
            )
        except UserError as error:
            typer.echo(str(error))

    def _ask_streams(self, profiles: Sequence[StreamProfile]) -> tuple[int, int | None]:
        """Ask which stream viewers get, and in which people are tracked; return their places."""
        if len(profiles) < 2:  # noqa: PLR2004 — a pair
            return 0, None
        pair = propose_pair(profiles)
        number = typer.prompt("Stream", default=pair.source + 1, type=int)
        source = max(1, min(number, len(profiles))) - 1
        proposed = 0 if pair.substream in {None, source} else (pair.substream or 0) + 1
        number = typer.prompt("Substream, in which people are tracked (0: none)", default=proposed, type=int)
        substream = max(0, min(number, len(profiles))) - 1
        return source, None if substream in {-1, source} else substream

    def _ask_address(self, question: str = "Address of a camera (empty: no more)") -> bool:
        """Ask for an address and try it; return whether there was one."""
        address = typer.prompt(question, default="", show_default=False)
        if not address:
            return False
        try:
            login = self._ask_login() if "://" in address and "@" not in address else ("", "")
            typer.echo("Trying …")
            self._take(self._runner.run(self._session.add(parse_addresses(address, *login))))
        except UserError as error:
            typer.echo(str(error))
        return True

    def _ask_login(self) -> tuple[str, str]:
        """Ask for a user and password; the last ones are proposed."""
        user = typer.prompt(f"User ({_NO_USER}: none)", default=self._user or _NO_USER)
        if user == _NO_USER:
            return "", ""
        kept = " (empty: as before)" if self._password else ""
        entered = typer.prompt(f"Password{kept}", default="", show_default=False, hide_input=True)
        self._user, self._password = user, entered or self._password
        return self._user, self._password

    def _take(self, camera: TriedCamera) -> None:
        """Name a camera that sends pictures."""
        tracked = f"; people are tracked in {camera.tracked_in}" if camera.tracked_in else ""
        typer.echo(f"It sends {camera.sends}{tracked}.")
        while True:
            name = typer.prompt("Name", default=camera.name)
            try:
                self._session.rename(camera.key, name)
            except UserError as error:
                typer.echo(str(error))
            else:
                return

    def _write(self) -> None:
        if not self._session.cameras:
            raise UserError("init: no camera was added; nothing was written")
        proposal = self._session.proposal
        name = typer.prompt("Name of the site", default=free_name(self._session.path.stem, set()))
        chosen = SiteProposal(
            typer.prompt("Frames a second", default=proposal.fps, type=float),
            typer.prompt("Width of the pictures", default=proposal.width, type=int),
            typer.prompt("Height of the pictures", default=proposal.height, type=int),
        )
        self._session.write(name, chosen)
        kept = f"; the earlier file is {self._session.kept}" if self._session.kept else ""
        typer.echo(f"Wrote {self._session.path}{kept}. Start the site:\n\n  myview up {self._session.path}\n")
