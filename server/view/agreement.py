"""The H.264 parameter sets that all cameras of a site share."""

from __future__ import annotations

from server.view.h264 import ParameterSets


class ParameterMismatchError(Exception):
    """The camera's H.264 parameters are not the site's: its frames would decode into wrong pixels."""


class Agreement:
    """The first key frame of a site fixes the parameter sets; whoever has others cannot be spliced in."""

    def __init__(self) -> None:
        self.parameters: ParameterSets | None = None

    def check(self, found: ParameterSets | None) -> None:
        """Compare the parameter sets of a key frame, None where it has none.

        Raises:
            ParameterMismatchError: they are missing, or not the site's.
        """
        if found is None:
            raise ParameterMismatchError("a key frame without parameter sets")
        if self.parameters is None:
            self.parameters = found
        elif found != self.parameters:
            raise ParameterMismatchError("its H.264 parameter sets differ from the other cameras'")
