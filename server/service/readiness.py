"""Readiness: whether a best view can be served now, and why not."""

from __future__ import annotations

from server.service.pipeline import BestViewPipeline

_MAX_PULSE_GAP_S = 2.0
"""Without a pulse for longer, pulses count as stopped; on slow sites three pulses must be missing."""
_SLACK_S = 3.0
"""How far a busy machine may be behind, beyond the delays by design."""


def why_not_ready(pipeline: BestViewPipeline) -> list[str]:
    """Return why the best view cannot be served now; empty: ready.

    Required are pulses, a camera that delivers, and decisions that keep up with the pulses.
    """
    reasons = []
    fps = pipeline.config.site.fps
    since_pulse = pipeline.pulses.seconds_since_newest
    if pipeline.pulses.newest < 0:
        reasons.append("no pulse received from the pulse server")
    elif since_pulse is not None and since_pulse > max(_MAX_PULSE_GAP_S, 3 / fps):
        reasons.append(f"no pulse received for {since_pulse:.0f} s")
    if not any(state.label == "live" for state in pipeline.ingest.states.values()):
        reasons.append("no camera delivers frames")
    behind = pipeline.pulses.newest + 1 - pipeline.decision_state.end
    if pipeline.decision_state.end == 0:
        reasons.append("nothing has been decided yet")
    elif behind > max_normal_delay(pipeline):
        reasons.append(f"decisions are {behind / fps:.1f} s behind the pulses")
    return reasons


def max_normal_delay(pipeline: BestViewPipeline) -> int:
    """Return the largest normal delay of decisions, in pulses."""
    config, fps = pipeline.config, pipeline.config.site.fps
    wait_s = config.view.late_after_s + config.track.backlog_s + _SLACK_S
    designed = config.lookahead_of(pipeline.decider.view) + config.gop + config.window.stride
    return designed + round(wait_s * fps)
