"""Whether a camera's own video could be sent on as it is, and how the camera must be set for that."""

from __future__ import annotations

from dataclasses import dataclass

from server.config.sections import EncodeSettings
from server.setup.proposal import SiteProposal
from server.setup.trial_messages import StreamTrial

_SAME_RATE = 0.03
"""Relative deviation of a camera's rate, which is measured."""
_CODEC = EncodeSettings().codec


@dataclass(frozen=True, slots=True)
class OwnVideo:
    """What is known of passing a camera's own video through.

    Attributes:
        fits: whether it fits as it is.
        wanted: settings of the camera with which it would; empty: it fits, or no setting of the camera helps.
    """

    fits: bool = False
    wanted: str = ""


NOT_COMPARED = OwnVideo()


def compare_own_video(trial: StreamTrial, site: SiteProposal) -> OwnVideo:
    """Compare what a camera sends with the streams of a site that is set up, with default settings else."""
    if not trial.codec or trial.codec not in {"h264", "hevc"} or not trial.is_upright:
        return NOT_COMPARED
    gop = EncodeSettings().frames_per_gop(site.fps)
    wanted = []
    if trial.codec != _CODEC:
        wanted.append("H.264")
    if (trial.width, trial.height) != (site.width, site.height):
        wanted.append(f"{site.width}x{site.height} pixels")
    if not trial.fps or abs(trial.fps / site.fps - 1) > _SAME_RATE:
        wanted.append(f"{site.fps:g} frames a second")
    if trial.gop != gop:
        wanted.append(
            f"a fixed GOP (I-frame interval) of {gop} frames" + (f", not {trial.gop}" * bool(trial.gop))
        )
    if trial.reorders:
        wanted.append("no B frames")
    return OwnVideo(not wanted, "; ".join(wanted))
