"""Writes a mid-gray H.265 keyframe, for viewers who may not see the cameras' pictures.

The picture carries the parameter sets of its stream, so that a decoder accepts it like a camera's keyframe.
"""

from __future__ import annotations

from functools import lru_cache

from server.media.h265.nal import NAL_IDR_N_LP, join_sample
from server.media.h265.parameter_sets import H265ParameterSets
from server.media.h265.slice_data import gray_blocks
from server.media.h265.slice_header import write_intra


@lru_cache(maxsize=16)
def gray_keyframe(parameters: H265ParameterSets) -> bytes:
    """Return the sample of a gray keyframe: length-prefixed NAL units, parameter sets first.

    Raises:
        UnsupportedParametersError: the parameter sets are damaged, or use rare features.
    """
    syntax = parameters.syntax
    picture = write_intra(syntax, NAL_IDR_N_LP, gray_blocks(syntax))
    return join_sample([parameters.vps, parameters.sps, parameters.pps, picture])
