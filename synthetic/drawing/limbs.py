"""A body as tapered limbs between joints, each of one color."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats
from synthetic.drawing.clothing import Outfit
from synthetic.drawing.skeleton import Joint
from synthetic.room.room import Color


@dataclass(frozen=True, slots=True)
class Limb:
    """A capsule from one joint to another; radii are shares of the body's height."""

    start: Joint
    end: Joint
    radius_start: float
    radius_end: float
    color: Color
    tones: int = 4  # number of the figure's tones; with fewer, an adjacent limb has the highlight


@dataclass(frozen=True, slots=True)
class LimbGroup:
    """Limbs of one color that are drawn together, without seams."""

    limbs: tuple[Limb, ...]
    depth_offset: float = 0.0  # meters nearer in the drawing order, to break ties


@dataclass(frozen=True, slots=True)
class CapsuleBody:
    """The limbs of one dressed body as arrays, for drawing many at once."""

    starts: NDArray[np.intp]  # (L,)
    ends: NDArray[np.intp]  # (L,)
    radii: Floats  # (L, 2) meters
    colors: Floats  # (L, 3) red, green, blue in 0..1
    tones: tuple[int, ...]  # of each limb
    groups: tuple[NDArray[np.intp], ...]  # the limbs of each group
    depth_offset: Floats  # (M,) meters


@lru_cache(maxsize=256)
def build_body(outfit: Outfit) -> CapsuleBody:
    """Build the limbs of a body in an outfit."""
    groups = [*_legs(outfit), *_trunk(outfit), *_arms(outfit), *_head(outfit)]
    limbs = [limb for group in groups for limb in group.limbs]
    ends = np.cumsum([len(group.limbs) for group in groups])
    return CapsuleBody(
        np.array([limb.start for limb in limbs], dtype=np.intp),
        np.array([limb.end for limb in limbs], dtype=np.intp),
        np.array([(limb.radius_start, limb.radius_end) for limb in limbs]) * outfit.height,
        np.array([limb.color for limb in limbs]),
        tuple(limb.tones for limb in limbs),
        tuple(np.split(np.arange(len(limbs)), ends[:-1])),
        np.array([group.depth_offset for group in groups]),
    )


def _legs(outfit: Outfit) -> list[LimbGroup]:
    girth = outfit.build
    shin = outfit.lower if outfit.legs == "trousers" else outfit.skin
    groups = []
    for side in range(2):
        hip, knee, ankle, toe = (Joint(first + side) for first in (0, 2, 4, 6))
        groups += [
            LimbGroup((Limb(ankle, toe, 0.025, 0.018, outfit.shoes),)),
            *_joined(
                Limb(knee, ankle, 0.035 * girth, 0.024, shin),
                Limb(hip, knee, 0.052 * girth, 0.036 * girth, outfit.lower),
                0.01,
            ),
        ]
    if outfit.legs == "skirt":
        limbs = [
            Limb(hip, hem, 0.054, 0.056, outfit.lower)
            for hip, hem in (
                (Joint.HIP_L, Joint.HEM_L),
                (Joint.HIP_R, Joint.HEM_R),
                (Joint.BELLY, Joint.HEM_L),
            )
        ]
        groups.append(LimbGroup(tuple(limbs), 0.05))
    return groups


def _joined(outer: Limb, inner: Limb, depth_offset: float) -> list[LimbGroup]:
    """Join two limbs into one group if they have one color; otherwise cloth lies over skin."""
    if outer.color == inner.color:
        return [LimbGroup((outer, inner), depth_offset)]
    return [LimbGroup((outer,), depth_offset), LimbGroup((inner,), depth_offset + 0.02)]


def _trunk(outfit: Outfit) -> list[LimbGroup]:
    girth = outfit.build
    torso = (
        Limb(Joint.HIP_L, Joint.SHOULDER_L, 0.052 * girth, 0.044, outfit.upper, 2),
        Limb(Joint.HIP_R, Joint.SHOULDER_R, 0.052 * girth, 0.044, outfit.upper, 2),
        Limb(Joint.HIP_L, Joint.HIP_R, 0.051 * girth, 0.051 * girth, outfit.upper, 2),
        Limb(Joint.NECK, Joint.SHOULDER_L, 0.042, 0.042, outfit.upper, 3),
        Limb(Joint.NECK, Joint.SHOULDER_R, 0.042, 0.042, outfit.upper, 3),
        Limb(Joint.BELLY, Joint.NECK, 0.060 * girth, 0.040, outfit.upper, 3),
        Limb(Joint.BELLY, Joint.CHEST, 0.070 * girth, 0.078 * girth, outfit.upper),
    )
    hips = Limb(Joint.HIP_L, Joint.HIP_R, 0.054 * girth, 0.054 * girth, outfit.lower)
    groups = [LimbGroup((hips,), 0.02), LimbGroup(torso, 0.04)]
    if outfit.backpack is not None:
        groups.append(LimbGroup((Limb(Joint.PACK_TOP, Joint.PACK_LOW, 0.060, 0.072, outfit.backpack),), 0.03))
    return groups


def _arms(outfit: Outfit) -> list[LimbGroup]:
    fore = outfit.upper if outfit.sleeves == "long" else outfit.skin
    groups = []
    for side in range(2):
        shoulder, elbow, hand = (Joint(first + side) for first in (8, 10, 12))
        groups += [
            LimbGroup((Limb(hand, hand, 0.022, 0.022, outfit.skin),), 0.02),
            *_joined(
                Limb(elbow, hand, 0.026, 0.020, fore),
                Limb(shoulder, elbow, 0.038, 0.028, outfit.upper),
                0.045,
            ),
        ]
    return groups


def _head(outfit: Outfit) -> list[LimbGroup]:
    groups = [
        LimbGroup((Limb(Joint.THROAT, Joint.HEAD, 0.027, 0.027, outfit.skin),), 0.045),
        LimbGroup((Limb(Joint.HEAD, Joint.CHIN, 0.052, 0.038, outfit.skin),), 0.06),
    ]
    hair = [Limb(Joint.HAIR, Joint.HAIR, 0.061, 0.061, outfit.hair)]
    if outfit.hair_cut == "long":
        hair.append(Limb(Joint.HAIR, Joint.NAPE, 0.060, 0.050, outfit.hair))
    if outfit.hair_cut == "bun":
        hair.append(Limb(Joint.CROWN, Joint.CROWN, 0.032, 0.032, outfit.hair))
    return [*groups, LimbGroup(tuple(hair), 0.055)]
