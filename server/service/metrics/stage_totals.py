"""What a camera's messages say of its stages, added up since the service began."""

from __future__ import annotations

from server.messaging.messages import CameraTracks, FrameHeader
from server.service.metrics.histogram import Histogram


class StageTotals:
    """How long each stage of a camera took, and how well its windows were solved.

    All times are differences of the camera's own clock.

    Attributes:
        take: from a pulse to its picture.
        encode: from the picture to its access unit.
        search: looking for people in a frame: the mean of each window.
        solve: following everybody to the end of a window, its program solved.
        track: from the pulse of a window's last frame to its tracks, with all that it waited for.
        windows: how many programs were solved.
        certified: how many answers of them are proven to be the best there is.
        gap: the sum of the gaps of the others.
        mended: how many windows have changed what was final, as an operator pointed at somebody.
    """

    def __init__(self) -> None:
        self.take, self.encode = Histogram(), Histogram()
        self.search, self.solve, self.track = Histogram(), Histogram(), Histogram()
        self.windows = self.certified = self.mended = 0
        self.gap = 0.0

    @property
    def stages(self) -> dict[str, Histogram]:
        """Return the stages by name, in the order of a frame's way."""
        return {name: getattr(self, name) for name in ("take", "encode", "search", "solve", "track")}

    def frame(self, head: FrameHeader) -> None:
        """Count a frame."""
        self.take.observe(head.taken - head.due)
        self.encode.observe(head.encoded - head.taken)

    def window(self, tracks: CameraTracks, due: float | None, *, proven: bool) -> None:
        """Count a window; ``due`` is when its last frame was, None: not known."""
        self.mended += tracks.revised_from is not None
        if tracks.search_s is not None:
            self.search.observe(tracks.search_s)
        if tracks.solve is not None:
            self.windows += 1
            self.certified += proven
            self.gap += 0.0 if proven else tracks.solve.gap
            if tracks.solve_s is not None:
                self.solve.observe(tracks.solve_s)
        if due is not None and tracks.solved_at > 0:
            self.track.observe(tracks.solved_at - due)
