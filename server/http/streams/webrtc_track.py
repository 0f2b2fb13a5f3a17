"""What WebRTC needs of aiortc: a track of encoded pictures, and the answer to an offer. Loads FFmpeg."""

from __future__ import annotations

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

_TIME_BASE = Fraction(1, 90_000)


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
    try:
        await connection.setRemoteDescription(RTCSessionDescription(offer, "offer"))
        _send(track, connection)
        await connection.setLocalDescription(await connection.createAnswer())
    except UserError:
        await connection.close()
        raise
    except Exception as error:  # aiortc raises anything for what it cannot read
        await connection.close()
        reason = " ".join(str(error).split())[:_SHOWN]
        raise UserError(f"the SDP offer is invalid: {reason or type(error).__name__}") from error
    except BaseException:
        await connection.close()
        raise
    return connection, connection.localDescription.sdp


def _send(track: EncodedTrack, connection: RTCPeerConnection) -> None:
    """Send a track as the one video that an offer wants to receive.

    Raises:
        UserError: it wants none, or another codec.
    """
    media = connection.getTransceivers()
    videos = [each for each in media if each.kind == "video"]
    offered = [codec for each in videos for codec in each._codecs if codec.name == "H264"]  # noqa: SLF001
    if len(videos) != 1 or len(media) > _MEDIA_MAX or not offered:
        raise UserError("the SDP offer has no H.264 video to receive, or more than one")
    known = RTCRtpSender.getCapabilities("video").codecs
    videos[0].setCodecPreferences([codec for codec in known if codec.name == "H264"])
    connection.addTrack(track)


_MEDIA_MAX = 2
"""Media in an offer: video, and sound, which is not sent."""
_SHOWN = 200
"""Characters of a library's message that an error repeats."""
