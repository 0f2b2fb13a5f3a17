"""What a figure is drawn from: tapered limbs between joints, each of one colour."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from synthetic.cameras.pinhole import Floats
from synthetic.drawing.clothing import Outfit
from synthetic.drawing.skeleton import Joint
from synthetic.room.room import Colour


@dataclass(frozen=True, slots=True)
class Limb:
    """A capsule from one joint to another; radii are shares of the body's height."""

    start: Joint
    end: Joint
    radius_start: float
    radius_end: float
    colour: Colour
    tones: int = 4  # how many of the figure's tones: fewer leave the highlight to a limb beside


@dataclass(frozen=True, slots=True)
class Member:
    """Limbs of one colour that are drawn as one, without seams."""

    limbs: tuple[Limb, ...]
    nearer: float = 0.0  # metres that it is taken nearer by, where members would tie


@dataclass(frozen=True, slots=True)
class Body:
    """The limbs of one outfit as arrays, for drawing many at once."""

    starts: NDArray[np.intp]  # (L,)
    ends: NDArray[np.intp]  # (L,)
    radii: Floats  # (L, 2) metres
    colours: Floats  # (L, 3) red, green, blue in 0..1
    tones: tuple[int, ...]  # of each limb
    members: tuple[NDArray[np.intp], ...]  # the limbs of each member
    nearer: Floats  # (M,) metres


@lru_cache(maxsize=256)
def body(outfit: Outfit) -> Body:
    """Dress a body."""
    members = [*_legs(outfit), *_trunk(outfit), *_arms(outfit), *_head(outfit)]
    limbs = [limb for member in members for limb in member.limbs]
    ends = np.cumsum([len(member.limbs) for member in members])
    return Body(
        np.array([limb.start for limb in limbs], dtype=np.intp),
        np.array([limb.end for limb in limbs], dtype=np.intp),
        np.array([(limb.radius_start, limb.radius_end) for limb in limbs]) * outfit.height,
        np.array([limb.colour for limb in limbs]),
        tuple(limb.tones for limb in limbs),
        tuple(np.split(np.arange(len(limbs)), ends[:-1])),
        np.array([member.nearer for member in members]),
    )


def _legs(outfit: Outfit) -> list[Member]:
    girth = outfit.build
    shin = outfit.lower if outfit.legs == "trousers" else outfit.skin
    members = []
    for side in range(2):
        hip, knee, ankle, toe = (Joint(first + side) for first in (0, 2, 4, 6))
        members += [
            Member((Limb(ankle, toe, 0.025, 0.018, outfit.shoes),)),
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
        members.append(Member(tuple(limbs), 0.05))
    return members


def _joined(outer: Limb, inner: Limb, nearer: float) -> list[Member]:
    """Join two limbs into one member where they have one colour; otherwise cloth lies over skin."""
    if outer.colour == inner.colour:
        return [Member((outer, inner), nearer)]
    return [Member((outer,), nearer), Member((inner,), nearer + 0.02)]


def _trunk(outfit: Outfit) -> list[Member]:
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
    members = [Member((hips,), 0.02), Member(torso, 0.04)]
    if outfit.backpack is not None:
        members.append(Member((Limb(Joint.PACK_TOP, Joint.PACK_LOW, 0.060, 0.072, outfit.backpack),), 0.03))
    return members


def _arms(outfit: Outfit) -> list[Member]:
    fore = outfit.upper if outfit.sleeves == "long" else outfit.skin
    members = []
    for side in range(2):
        shoulder, elbow, hand = (Joint(first + side) for first in (8, 10, 12))
        members += [
            Member((Limb(hand, hand, 0.022, 0.022, outfit.skin),), 0.02),
            *_joined(
                Limb(elbow, hand, 0.026, 0.020, fore),
                Limb(shoulder, elbow, 0.038, 0.028, outfit.upper),
                0.045,
            ),
        ]
    return members


def _head(outfit: Outfit) -> list[Member]:
    members = [
        Member((Limb(Joint.THROAT, Joint.HEAD, 0.027, 0.027, outfit.skin),), 0.045),
        Member((Limb(Joint.HEAD, Joint.CHIN, 0.052, 0.038, outfit.skin),), 0.06),
    ]
    hair = [Limb(Joint.HAIR, Joint.HAIR, 0.061, 0.061, outfit.hair)]
    if outfit.hair_cut == "long":
        hair.append(Limb(Joint.HAIR, Joint.NAPE, 0.060, 0.050, outfit.hair))
    if outfit.hair_cut == "bun":
        hair.append(Limb(Joint.CROWN, Joint.CROWN, 0.032, 0.032, outfit.hair))
    return [*members, Member(tuple(hair), 0.055)]
