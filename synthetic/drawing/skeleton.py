"""A walking skeleton: the joints in space for a pose. All measures are shares of the body's height."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from synthetic.cameras.pinhole import Floats
from synthetic.walking.trajectory import Pose

STRIDE = 0.69  # length of two steps
_THIGH, _SHIN, _ANKLE = 0.243, 0.243, 0.042
_HIP, _SHOULDER, _NECK, _HEAD = 0.525, 0.790, 0.815, 0.926
_HIP_SIDE, _SHOULDER_SIDE = 0.050, 0.104
_UPPER_ARM, _FOREARM, _FOOT = 0.168, 0.165, 0.125
_STANCE = 0.6  # the share of a stride in which a foot stands
_BRISK = 0.75  # meters per second: the pace of a full swing
_RUN = (2.6, 4.6)  # meters per second at which running begins, and is at its fastest


class Joint(IntEnum):
    """Rows of the joint array; left comes before right."""

    HIP_L = 0
    HIP_R = 1
    KNEE_L = 2
    KNEE_R = 3
    ANKLE_L = 4
    ANKLE_R = 5
    TOE_L = 6
    TOE_R = 7
    SHOULDER_L = 8
    SHOULDER_R = 9
    ELBOW_L = 10
    ELBOW_R = 11
    HAND_L = 12
    HAND_R = 13
    NECK = 14
    HEAD = 15
    HAIR = 16
    NAPE = 17
    CROWN = 18
    CHEST = 19
    BELLY = 20
    PACK_TOP = 21
    PACK_LOW = 22
    HEM_L = 23
    HEM_R = 24
    CHIN = 25
    THROAT = 26


@dataclass(frozen=True, slots=True)
class _Step:
    ahead: float
    lift: float
    pitch: float  # of the foot, radians; toes down is positive


def place_joints(pose: Pose, height: float) -> Floats:
    """Return the joints ``(len(Joint), 3)``, in meters, of a body of a height in meters."""
    local = _local(pose, height) * height
    cos, sin = math.cos(pose.heading), math.sin(pose.heading)
    world = np.empty_like(local)
    world[:, 0] = pose.x + local[:, 0] * cos - local[:, 1] * sin
    world[:, 1] = pose.y + local[:, 0] * sin + local[:, 1] * cos
    world[:, 2] = local[:, 2]
    return world


def _local(pose: Pose, height: float) -> Floats:
    """Return the joints in the body's frame: ahead, left, up."""
    phase = pose.walked / (STRIDE * height) % 1.0
    swing = min(pose.speed / _BRISK, 1.0)
    bob = -0.015 * swing * (1 + math.cos(4 * math.pi * (phase - 0.05)))
    run = min(max((pose.speed - _RUN[0]) / (_RUN[1] - _RUN[0]), 0.0), 1.0)
    lean = 0.022 * swing + 0.055 * run
    body = np.zeros((len(Joint), 3))
    body[Joint.NECK] = (lean, 0, _NECK + bob)
    body[Joint.THROAT] = (lean + 0.004, 0, 0.862 + bob)
    body[Joint.HEAD] = (lean + 0.012, 0, _HEAD + bob)
    body[Joint.CHIN] = (lean + 0.026, 0, _HEAD - 0.035 + bob)
    body[Joint.HAIR] = (lean - 0.008, 0, _HEAD + 0.012 + bob)
    body[Joint.CROWN] = (lean - 0.055, 0, _HEAD + 0.045 + bob)
    body[Joint.NAPE] = (lean - 0.042, 0, _HEAD - 0.085 + bob)
    body[Joint.CHEST] = (lean, 0, 0.735 + bob)
    body[Joint.BELLY] = (lean / 2, 0, 0.60 + bob)
    body[Joint.PACK_TOP] = (lean - 0.085, 0, 0.765 + bob)
    body[Joint.PACK_LOW] = (lean - 0.09, 0, 0.645 + bob)
    for side, sign in ((0, 1.0), (1, -1.0)):
        turn = (phase + side * 0.5) % 1.0
        _leg(body, side, sign, _step(turn, swing, run), bob)
        body[Joint.SHOULDER_L + side] = (lean, sign * _SHOULDER_SIDE, _SHOULDER + bob)
        _arm(body, side, sign, turn, swing, run)
        knee = body[Joint.KNEE_L + side]
        body[Joint.HEM_L + side] = (knee[0] * 0.8, sign * 0.062, knee[2] + 0.01)
    return body


def _step(turn: float, swing: float, run: float) -> _Step:
    reach = STRIDE * _STANCE / 2 * swing * (1 + 0.2 * run)
    if turn < _STANCE:
        ahead = reach * (1 - 2 * turn / _STANCE)
        late = max(turn - 0.42, 0.0) / (_STANCE - 0.42)  # the heel rises before the foot leaves the floor
        return _Step(
            ahead, 0.035 * late * swing, 0.5 * late * swing - 0.25 * max(0.08 - turn, 0) / 0.08 * swing
        )
    share = (turn - _STANCE) / (1 - _STANCE)
    smooth = share * share * (3 - 2 * share)
    lift = (0.035 * (1 - share) + (0.050 + 0.13 * run) * math.sin(math.pi * math.sqrt(share))) * swing
    return _Step(reach * (2 * smooth - 1), lift, (0.55 * (1 - 1.6 * share)) * swing)


def _leg(body: Floats, side: int, sign: float, step: _Step, bob: float) -> None:
    hip = np.array([0.0, sign * _HIP_SIDE, _HIP + bob])
    ankle = np.array([step.ahead, sign * (_HIP_SIDE - 0.008), _ANKLE + step.lift])
    span: Floats = ankle - hip
    length = float(np.hypot(span[0], span[2]))
    bend = math.acos(min(length / (_THIGH + _SHIN), 1.0))
    angle = math.atan2(span[0], -span[2]) + bend
    thigh = np.array([_THIGH * math.sin(angle), 0.0, -_THIGH * math.cos(angle)])
    drop = 0.02 + _FOOT * math.sin(step.pitch)
    foot = np.array([_FOOT * math.cos(step.pitch), sign * 0.012, max(-drop, 0.016 - ankle[2])])
    body[Joint.HIP_L + side] = hip
    body[Joint.KNEE_L + side] = hip + thigh
    body[Joint.ANKLE_L + side] = ankle
    body[Joint.TOE_L + side] = ankle + foot


def _arm(body: Floats, side: int, sign: float, turn: float, swing: float, run: float) -> None:
    """Set an arm's joints: it swings against its leg, and runners bend it."""
    back = math.cos(2 * math.pi * (turn - 0.05))
    angle = -(0.42 + 0.25 * run) * swing * back + 0.03 - 0.15 * run
    bent = angle + 0.22 + 0.28 * swing * (1 - back) / 2 + 1.15 * run
    out = sign * 0.030
    upper = np.array([_UPPER_ARM * math.sin(angle), out, -_UPPER_ARM * math.cos(angle)])
    fore = np.array([_FOREARM * math.sin(bent), -out * 0.2, -_FOREARM * math.cos(bent)])
    body[Joint.ELBOW_L + side] = body[Joint.SHOULDER_L + side] + upper
    body[Joint.HAND_L + side] = body[Joint.ELBOW_L + side] + fore
