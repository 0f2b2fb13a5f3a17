"""Messages to and from the process that speaks to cameras, MessagePack, and the functions that run it.

A camera may send anything. FFmpeg and the SOAP library read it in a process of their own with limited memory
and time, so that no camera can harm the one that serves.
"""

from __future__ import annotations

from typing import TypeVar

import msgspec

from server.system.errors import UserError, reason_of
from server.system.worker.process import WorkerDiedError
from server.system.worker.single_request import ask_new_worker

MODULE = "server.setup"
TRIAL_S = 40.0
"""Longest time that a camera is tried, with the start of the process on a busy machine."""
_QUERY_S = 60.0

Answer = TypeVar("Answer", bound=msgspec.Struct)


class StreamRequest(msgspec.Struct, frozen=True, tag="stream"):
    """A source to open."""

    source: str
    """With the password."""
    options: dict[str, str] = {}
    site: str = ""
    """A configuration file; the source's own video must fit into that site's streams. Empty: it need not."""


class ProfilesRequest(msgspec.Struct, frozen=True, tag="profiles"):
    """An ONVIF service to ask for its streams."""

    host: str
    port: int
    user: str = ""
    password: str = ""
    encrypted: bool = False


class StreamTrial(msgspec.Struct, frozen=True):
    """What a source sends."""

    error: str = ""
    """Why nothing was received, or what does not fit, without passwords; empty: pictures were received."""
    width: int = 0
    height: int = 0
    fps: float = 0.0
    """Pictures per second by their time stamps; 0: not known."""
    codec: str = ""
    gop: int = 0
    """Pictures from one keyframe to the next; 0: they differ, or are more than were watched."""
    reorders: bool = False
    """Whether pictures are decoded in another order than shown."""
    is_upright: bool = True
    """Whether pictures are shown as they are stored, with square pixels."""
    kbps: float = 0.0
    has_sound: bool = False
    picture: bytes = b""
    """The last picture, JPEG."""


class StreamProfile(msgspec.Struct, frozen=True):
    """A media profile: a stream that a camera offers."""

    name: str
    address: str
    """Without user and password."""
    codec: str = ""
    width: int = 0
    height: int = 0
    fps: float = 0.0


class ProfileList(msgspec.Struct, frozen=True):
    """The streams that a camera offers, the largest first."""

    error: str = ""
    needs_password: bool = False
    """Whether the camera refused the user and password, or their absence."""
    profiles: list[StreamProfile] = []


async def try_stream(request: StreamRequest) -> StreamTrial:
    """Open a source and return what it sends, or why it does not."""
    try:
        return await _ask(request, StreamTrial, TRIAL_S)
    except UserError as error:
        return StreamTrial(error=str(error))


async def list_profiles(request: ProfilesRequest) -> ProfileList:
    """Return the streams that an ONVIF camera offers, or why it does not tell."""
    try:
        return await _ask(request, ProfileList, _QUERY_S)
    except UserError as error:
        return ProfileList(error=str(error))


async def _ask(request: msgspec.Struct, answer_type: type[Answer], seconds: float) -> Answer:
    """Run the process for one request.

    Raises:
        UserError: it cannot be started, died, or took too long.
    """
    try:
        return await ask_new_worker(MODULE, request, answer_type, seconds)
    except TimeoutError:
        raise UserError(f"no answer within {seconds:g} s") from None
    except OSError as error:
        raise UserError(f"the camera cannot be tried: {reason_of(error)}") from error
    except WorkerDiedError:
        raise UserError("what it sends cannot be read") from None
