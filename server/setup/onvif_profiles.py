"""Media profiles of an ONVIF camera (ONVIF Media, 5.2 and 5.15), by the library onvif-zeep-async."""

from __future__ import annotations

import asyncio
from importlib.util import find_spec
from typing import Any
from urllib.parse import urlsplit, urlunsplit

from server.setup.trial_messages import ProfileList, ProfilesRequest, StreamProfile
from server.system.errors import UserError
from server.system.printable import printable

INSTALL = "pip install 'myview[onvif]' lets MyView ask cameras for their streams; or enter the address"
_STREAM_SETUP = {"Stream": "RTP-Unicast", "Transport": {"Protocol": "RTSP"}}
_MAX_PROFILES = 16
_MAX_TEXT = 60
_MAX_ADDRESS = 500
_SECONDS = 30.0
_MAX_SIZE = 16_384
_MAX_FPS = 1000.0


def is_installed() -> bool:
    """Return whether the library is installed."""
    return find_spec("onvif") is not None


def query_profiles(request: ProfilesRequest) -> ProfileList:
    """Ask a camera for its streams; errors become a line in the answer."""
    if not is_installed():
        return ProfileList(error=INSTALL)
    if request.encrypted:
        return ProfileList(error="it offers ONVIF by HTTPS only, which is not supported; enter the address")
    try:
        return asyncio.run(_query(request))
    except TimeoutError:
        return ProfileList(error=f"no answer within {_SECONDS:g} s")
    except UserError as error:
        return ProfileList(error=str(error))
    except (Exception, RecursionError) as error:  # noqa: BLE001 — the library raises what the answer leads it to
        return _failure(error, request.user)


async def _query(request: ProfilesRequest) -> ProfileList:
    from onvif import ONVIFCamera  # noqa: PLC0415 — an extra, and slow to import

    async with asyncio.timeout(_SECONDS):
        camera = ONVIFCamera(
            request.host, request.port, request.user, request.password, no_cache=True, adjust_time=True
        )
        try:
            await camera.update_xaddrs()
            media = await camera.create_media_service()
            if urlsplit(media.xaddr).hostname != request.host:
                raise UserError("its media service is at another address than the camera")
            profiles = list(await media.GetProfiles() or [])[:_MAX_PROFILES]
            found = []
            for profile in profiles:
                answer = await media.GetStreamUri(
                    {"StreamSetup": _STREAM_SETUP, "ProfileToken": profile.token}
                )
                found.append(_profile(profile, str(answer.Uri), request.host))
        finally:
            await camera.close()
    usable = [profile for profile in found if profile is not None]
    if not usable:
        return ProfileList(error="it offers no RTSP stream; enter the address")
    return ProfileList(profiles=sorted(usable, key=lambda one: -one.width * one.height))


def _profile(profile: Any, address: str, host: str) -> StreamProfile | None:
    """Return a profile with its address; None: it has no video, or no address of a stream."""
    encoder = getattr(profile, "VideoEncoderConfiguration", None)
    local = stream_address(address, host)
    if encoder is None or local is None:
        return None
    resolution, rate = getattr(encoder, "Resolution", None), getattr(encoder, "RateControl", None)
    return StreamProfile(
        name=printable(str(profile.Name or profile.token))[:_MAX_TEXT],
        address=local,
        codec=printable(str(encoder.Encoding or ""))[:_MAX_TEXT],
        width=int(_bounded(getattr(resolution, "Width", 0), _MAX_SIZE)),
        height=int(_bounded(getattr(resolution, "Height", 0), _MAX_SIZE)),
        fps=_bounded(getattr(rate, "FrameRateLimit", 0), _MAX_FPS),
    )


def stream_address(address: str, host: str) -> str | None:
    """Return a stream's address at the camera's own host, without a login; None: it is not RTSP.

    Cameras behind a router report addresses that only they know; and none may direct a password elsewhere.
    """
    try:
        parts = urlsplit(address)
        port = parts.port
    except ValueError:
        return None
    if parts.scheme not in {"rtsp", "rtsps"} or len(address) > _MAX_ADDRESS or not address.isprintable():
        return None
    place = host if port is None else f"{host}:{port}"
    return urlunsplit((parts.scheme, place, parts.path, parts.query, ""))


def _bounded(value: Any, most: float) -> float:
    try:
        number = float(value or 0)
    except (TypeError, ValueError):
        return 0.0
    return number if 0 <= number <= most else 0.0


def _failure(error: BaseException, user: str) -> ProfileList:
    """Return the line for an error of the library, whose text may contain anything the camera sent."""
    text = f"{type(error).__name__} {error}".lower()
    words = ("auth", "not authorized", "unauthorized", "401", "sender not", "password")
    if any(word in text for word in words):
        reason = "it refuses this user and password" if user else "it wants a user and password"
        return ProfileList(error=reason, needs_password=True)
    if isinstance(error, OSError) or "connect" in text or "timeout" in text:
        return ProfileList(error="its ONVIF service cannot be reached")
    return ProfileList(error="its ONVIF answer cannot be read; enter the address")
