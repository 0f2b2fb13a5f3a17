"""Whether a best view can be served now, and why not."""

from __future__ import annotations

from server.service.pipeline import BestViewPipeline

_SILENT_S = 2.0
"""Pulses that did not come for so long have stopped; slow sites wait for three of theirs."""
_SLACK_S = 3.0
"""What a busy machine may be behind by, beyond what is waited for by design."""


def why_not_ready(service: BestViewPipeline) -> list[str]:
    """Return what prevents the best view from being served now; empty: ready.

    It takes pulses, a camera that delivers, and decisions that keep up with the pulses.
    """
    reasons = []
    fps = service.config.site.fps
    silent = service.seconds_since_pulse
    if service.pulse < 0:
        reasons.append("no pulse has come from the pulse server")
    elif silent is not None and silent > max(_SILENT_S, 3 / fps):
        reasons.append(f"no pulse has come for {silent:.0f} s")
    if not any(state.label == "live" for state in service.ingest.states.values()):
        reasons.append("no camera delivers frames")
    behind = service.pulse + 1 - service.decision_state.end
    if service.decision_state.end == 0:
        reasons.append("nothing has been decided yet")
    elif behind > most_behind(service):
        reasons.append(f"decisions are {behind / fps:.1f} s behind the pulses")
    return reasons


def most_behind(service: BestViewPipeline) -> int:
    """Return the largest normal delay of decisions, in pulses."""
    config, fps = service.config, service.config.site.fps
    waits = config.view.late_after_s + config.track.backlog_s + _SLACK_S
    designed = service.decider.view.lookahead + config.encode.gop + config.track.window.stride
    return designed + round(waits * fps)
