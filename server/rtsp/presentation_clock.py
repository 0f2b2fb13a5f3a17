"""When each sample is due on the pipeline's clock: evenly, whatever the service's stream does."""

from __future__ import annotations

JUMP_S = 2.0
"""Further from its time than this, a sample begins a new count: the service has restarted, or skipped."""
_SLEW_S = 0.002
"""What each keyframe may correct: two clocks differ by some millionths."""


class PresentationClock:
    """Maps media time to the pipeline's running time, both in seconds.

    ``slack_s`` is how long before its time a keyframe may arrive: a best view comes in whole GOPs, which are
    sent at their own pace. Without slack every sample is due when it arrives, at the latest: a camera's first
    GOP, which comes at once, loses its pace, so that later samples are not held back.
    """

    def __init__(self, slack_s: float) -> None:
        self._slack_s = slack_s
        self._base: float | None = None
        """Running time at media time 0."""

    def due(self, media_s: float, running_s: float, *, is_key: bool) -> float:
        """Return when a sample that has arrived at ``running_s`` is due; never before 0."""
        if self._base is None or abs(self._base + media_s - running_s) > JUMP_S + self._slack_s:
            self._base = running_s - media_s
            return max(0.0, running_s)
        early = self._base + media_s - running_s
        if early > 0 and not self._slack_s:
            self._base -= early
        elif is_key:
            wanted = min(max(early, 0.0), self._slack_s) - early
            self._base += min(max(wanted, -_SLEW_S), _SLEW_S)
        return max(0.0, self._base + media_s)
