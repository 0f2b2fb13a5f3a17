"""What WebRTC needs of aiortc: a track of encoded pictures, and the answer to an offer. Loads FFmpeg."""

from __future__ import annotations

import logging
from collections.abc import AsyncIterator
from fractions import Fraction
from typing import Any

import av
from aiortc import (
    MediaStreamTrack,
    RTCConfiguration,
    RTCPeerConnection,
    RTCRtpSender,
    RTCSessionDescription,
)
from aiortc.mediastreams import MediaStreamError

from server.system.errors import UserError

for _library in ("aioice", "aiortc"):
    logging.getLogger(_library).setLevel(logging.WARNING)  # they log every check of viewers' addresses
_TIME_BASE = Fraction(1, 90_000)
_MEDIA_MAX = 2
"""Media in an offer: video, and sound, which is not sent."""
_SHOWN = 200
"""Characters of a library's message that an error repeats."""


class EncodedTrack(MediaStreamTrack):
    """A video track of encoded pictures, which aiortc only splits into packets (RFC 6184)."""

    kind = "video"

    def __init__(self, packets: AsyncIterator[tuple[bytes, int]]) -> None:
        super().__init__()
        self._packets = packets

    async def recv(self) -> av.Packet[Any]:
        """Return the next picture.

        Raises:
            MediaStreamError: the stream has ended.
        """
        if self.readyState != "live":
            raise MediaStreamError
        try:
            data, time = await anext(self._packets)
        except StopAsyncIteration:
            self.stop()
            raise MediaStreamError from None
        packet = av.Packet(data)
        packet.pts, packet.time_base = time, _TIME_BASE
        return packet


async def answer_offer(offer: str, track: EncodedTrack) -> tuple[RTCPeerConnection, str]:
    """Return the connection and the SDP answer to an offer; no other server is asked for addresses.

    Raises:
        UserError: the offer is invalid, or has no H.264.
    """
    connection = RTCPeerConnection(RTCConfiguration(iceServers=[]))
    # Before the offer is read: its codecs are matched then, and the first one that fits is sent.
    video = connection.addTransceiver(track, "sendonly")
    known = RTCRtpSender.getCapabilities("video").codecs
    video.setCodecPreferences([codec for codec in known if codec.name == "H264"])
    try:
        await connection.setRemoteDescription(RTCSessionDescription(offer, "offer"))
        _check_media(connection)
        await connection.setLocalDescription(await connection.createAnswer())
    except UserError:
        await connection.close()
        raise
    except Exception as error:  # aiortc raises anything for what it cannot read
        await connection.close()
        reason = " ".join(str(error).split())[:_SHOWN]
        raise UserError(
            f"the SDP offer is invalid, or has no H.264 to receive: {reason or type(error).__name__}"
        ) from error
    except BaseException:
        await connection.close()
        raise
    return connection, connection.localDescription.sdp


def _check_media(connection: RTCPeerConnection) -> None:
    """Check that an offer has one video, and perhaps sound.

    Raises:
        UserError: it has something else.
    """
    kinds = [each.kind for each in connection.getTransceivers()]
    if kinds.count("video") != 1 or len(kinds) > _MEDIA_MAX or connection.getTransceivers()[0].mid is None:
        raise UserError("the SDP offer has no H.264 video to receive, or more than one")
