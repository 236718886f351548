"""The body of a person: bones that swing in walking, bend in sitting and reach out in carrying.

A bone's frame has its origin in the joint nearer to the hips, z up along the body, and the person looks along -y.
Lengths are shares of the height: D. Winter, "Biomechanics and Motor Control of Human Movement", 2009, fig. 4.1.
"""

from enum import IntEnum

import numpy as np

from odom.geometry.arrays import Array
from sensors.arena.walkers import Posture

THIGH, SHIN, ANKLE = 0.245, 0.246, 0.039
"""From hip to knee, knee to ankle, ankle to ground: shares of the height."""
SPINE, SHOULDER, NECK = 0.05, 0.245, 0.262
"""Above the hips, where the spine bends, the shoulders are, and the neck begins: shares of the height."""
UPPER_ARM, FOREARM = 0.172, 0.146
"""From shoulder to elbow, elbow to wrist: shares of the height."""
HALF_HIPS, HALF_SHOULDERS = 0.052, 0.122
"""From the middle to a hip, to a shoulder: shares of the height."""
LEG_SWING, ARM_SWING, KNEE_SWING = 0.42, 0.45, 0.95
"""Radians at a brisk walk; the leg's fits the length of a stride, so that a foot on the ground slides little."""
SEATED_RAD = 1.45
"""How far hip and knee are bent in sitting."""


class Bone(IntEnum):
    """The bones; left and right are two of a kind."""

    PELVIS = 0
    TORSO = 1
    HEAD = 2
    LEFT_UPPER_ARM = 3
    LEFT_FOREARM = 4
    RIGHT_UPPER_ARM = 5
    RIGHT_FOREARM = 6
    LEFT_THIGH = 7
    LEFT_SHIN = 8
    LEFT_FOOT = 9
    RIGHT_THIGH = 10
    RIGHT_SHIN = 11
    RIGHT_FOOT = 12


AT_REST = Posture(0.0, 0.0, -np.pi / 2, 0.0, 0.0, 0.0, 0.0, 0.0)


def _joint(x: float, y: float, z: float, bend: float = 0.0, turn: float = 0.0) -> Array:
    """Return the frame of a joint at (x, y, z), bent forward (about x) and turned (about z), radians."""
    c, s, cz, sz = np.cos(bend), np.sin(bend), np.cos(turn), np.sin(turn)
    return np.array([[cz, -sz * c, -sz * s, x], [sz, cz * c, cz * s, y], [0.0, -s, c, z], [0.0, 0.0, 0.0, 1.0]])


def bones(height_m: float, posture: Posture) -> Array:
    """Return T_world_bone (13 x 4 x 4) of a person in a posture; its lower foot is on the ground."""
    p, swing = posture, posture.swing
    idle = 0.02 * np.sin(1.1 * p.t) + 0.012 * np.sin(2.3 * p.t + 1.0)
    hips, knees = [], []
    for side in (0.0, np.pi):
        hip = swing * (0.05 + LEG_SWING * np.sin(p.phase + side))
        knee = 0.06 + swing * KNEE_SWING * max(0.0, np.cos(p.phase + side)) ** 1.5
        hips.append((1 - p.sitting) * hip + SEATED_RAD * p.sitting)
        knees.append((1 - p.sitting) * knee + SEATED_RAD * p.sitting)
    reach = [THIGH * np.cos(hip) + SHIN * np.cos(knee - hip) for hip, knee in zip(hips, knees, strict=True)]
    up = max(reach) + ANKLE
    stoop = np.sin(np.pi * p.sitting) * 0.5 + 0.35 * np.sin(np.pi * p.holding)
    scale = np.eye(4)
    scale[:3, 3] = height_m

    def joint(x: float, y: float, z: float, bend: float = 0.0, turn: float = 0.0) -> Array:
        return _joint(x * height_m, y * height_m, z * height_m, bend, turn)

    world = _joint(p.x, p.y, 0.0, 0.0, p.heading + np.pi / 2)
    pelvis = world @ joint(0, 0, up, 0.0, 0.09 * swing * np.sin(p.phase))
    torso = pelvis @ joint(0, 0, SPINE, 0.0, -0.2 * swing * np.sin(p.phase))
    torso = torso @ _joint(0, 0, 0, -(0.03 + 0.05 * swing + stoop + idle))
    head = torso @ joint(0, 0, NECK, stoop * 0.6, 0.5 * np.sin(0.35 * p.t + p.x) * (1 - swing))
    found = [pelvis, torso, head]
    for side, phase in ((1.0, np.pi), (-1.0, 0.0)):
        free = -0.05 + swing * ARM_SWING * np.sin(p.phase + phase) + idle + 0.5 * p.sitting
        raise_rad = (1 - p.holding) * free + 0.75 * p.holding
        elbow = (1 - p.holding) * (0.2 + 0.25 * swing + 0.5 * p.sitting) + 0.85 * p.holding
        upper = torso @ joint(side * HALF_SHOULDERS, 0, SHOULDER, raise_rad, 0.0)
        found += [upper, upper @ joint(0, 0, -UPPER_ARM, elbow, side * 0.25 * p.holding)]
    for side, hip, knee in zip((1.0, -1.0), hips, knees, strict=True):
        thigh = pelvis @ joint(side * HALF_HIPS, 0, 0, hip)
        shin = thigh @ joint(0, 0, -THIGH, -knee)
        found += [thigh, shin, shin @ joint(0, 0, -SHIN, 0.85 * (knee - hip))]
    return np.stack(found)


def held(T_world_bone: Array, height_m: float, depth_m: float) -> Array:
    """Return T_world_carton of a carton `depth_m` deep in the arms of a person."""
    return np.asarray(T_world_bone[Bone.PELVIS] @ _joint(0.0, -0.14 - depth_m / 2, 0.14 * height_m))
