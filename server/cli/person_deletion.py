"""``myview delete-person``: what would be deleted of a person, and the deletion."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import msgspec
import typer

from client import AwayError as ServerAway
from client import ClientError, HttpSettings, PersonDeletion, ServerError, delete_person, plan_deletion
from server.system.errors import UnavailableError, UserError
from server.system.printable import printable


async def run_delete_person(
    url: str,
    number: int,
    recordings: Literal["keep", "delete"] | None,
    run: str | None,
    token: str | None,
    *,
    for_good: bool,
    as_json: bool,
) -> None:
    """Print what would be deleted of a person; with ``for_good``, delete it.

    Raises:
        UserError: there is no such person or session, or the server refuses.
        UnavailableError: the server cannot be reached, or its disk fails.
    """
    if for_good and recordings is None:
        raise UserError("delete-person: --for-good needs --recordings keep or --recordings delete")
    settings = HttpSettings(token=token)
    try:
        if recordings is not None and for_good:
            deletion = await delete_person(url, number, recordings, settings, run=run)
        else:
            deletion = await plan_deletion(url, number, settings, run=run)
    except ServerAway as error:
        is_unknown = for_good and not isinstance(error, ServerError)
        more = "; if it has begun it is completed: without --for-good this shows what is left"
        raise UnavailableError(f"delete-person: {error}{more if is_unknown else ''}") from error
    except (ClientError, ValueError) as error:
        raise UserError(f"delete-person: {error}") from error
    if as_json:
        typer.echo(msgspec.json.encode(deletion))
        return
    for line in _lines(deletion, recordings):
        typer.echo(printable(line) if not line.startswith(" ") else f"  {printable(line)}")


def _lines(deletion: PersonDeletion, recordings: str | None) -> Iterator[str]:
    """Yield the lines of a deletion: whose, what goes in any case, what with the recordings, and what now."""
    name = f" {deletion.name!r}" if deletion.name is not None else ""
    numbers = ", ".join(map(str, deletion.objects))
    run = f" of the session {deletion.run}" if deletion.run is not None else ""
    visible = "; visible now, and goes on as a new person" if deletion.visible else ""
    yield f"object {deletion.object}{name}{run}, with all numbers: {numbers}{visible}"
    yield (
        f"  name, looks and tracks; recorded decisions: {deletion.decisions} "
        f"(seen for {deletion.seen_s:g} s); events: {deletion.events}"
    )
    if recordings != "keep":
        lost = [f"{each.camera} {each.deleted_s:g} s" for each in deletion.cameras]
        lost += [f"sound {deletion.sound_s:g} s"] if deletion.sound_s else []
        others = [
            f"object {each.object}{f' of {each.run}' if each.run is not None else ''} {each.deleted_s:g} s"
            for each in deletion.others
        ]
        which = "video and sound" if recordings == "delete" else "video and sound, with --recordings delete"
        yield f"  {which}: {', '.join(lost) or 'none'}"
        yield f"  of it in best views of others: {', '.join(others) or 'none'}"
    yield from (f"  for you to change: {mention}" for mention in deletion.mentions)
    if deletion.state == "planned":
        yield "nothing is deleted: --for-good does it, with --recordings keep or delete"
    elif deletion.state == "running":
        yield "the deletion goes on; the service's log says when it is complete, or why not"
    else:
        yield "deleted"
