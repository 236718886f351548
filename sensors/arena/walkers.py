"""Where people are and what they do at any time: ways through the room, walked as people walk (see people.yaml)."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from scipy.ndimage import gaussian_filter1d

from odom.geometry.arrays import Array

FILE = Path(__file__).with_name("people.yaml")
RATE_HZ = 50
"""Samples a second of a walk; between them it is interpolated."""
SMOOTH_S, TURN_S = 0.28, 0.3
"""Deviation (s) of the Gaussians that smooth way and heading: less, people start and turn like machines."""
STRIDE = 0.83
"""Length of two steps, over a person's height."""
BRISK_M_S = 0.9
"""Speed at which legs and arms swing fully; slower, they swing less."""
SIT_S, GRASP_S = 1.3, 0.9
"""Seconds to sit down or get up, and to lift a carton or put it down."""
SEAT_BEHIND_M = 0.4
"""From where one stands before a seat to its middle."""


class Posture(NamedTuple):
    """Where a person stands (m), looks (rad), in which phase (rad) of two steps, and how much (0 to 1) it does what."""

    x: float
    y: float
    heading: float
    phase: float
    swing: float
    sitting: float
    holding: float
    t: float


@dataclass(frozen=True, eq=False)
class Walker:
    """One person's round: columns of `samples` are x, y, cos and sin of the heading, speed; `phase` rises with the way.

    `sits` and `carries` are the spans (seconds of the round) in which it does so.
    """

    round_s: float
    samples: Array
    phase: Array
    sits: tuple[tuple[float, float], ...]
    carries: tuple[tuple[float, float], ...]

    def posture(self, t: float) -> Posture:
        """Return what the person does at `t` seconds."""
        rounds, now = divmod(t, self.round_s)
        at = now * RATE_HZ
        k = int(at)
        f = at - k
        x, y, cosine, sine, speed = (1 - f) * self.samples[k] + f * self.samples[k + 1]
        phase = (1 - f) * self.phase[k] + f * self.phase[k + 1] + rounds * self.phase[-1]
        sitting = max((_within(now, span, SIT_S) for span in self.sits), default=0.0)
        holding = max((_within(now, span, GRASP_S) for span in self.carries), default=0.0)
        swing = min(speed / BRISK_M_S, 1.0) * (1.0 - sitting)
        heading = float(np.arctan2(sine, cosine))
        back = SEAT_BEHIND_M * sitting
        return Posture(
            float(x) - back * np.cos(heading), float(y) - back * np.sin(heading),
            heading, float(phase), swing, sitting, holding, t,
        )  # fmt: skip


def smooth_step(x: float) -> float:
    """Return 0 below 0, 1 above 1, and a smooth rise between."""
    x = min(max(x, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


def _within(t: float, span: tuple[float, float], seconds: float) -> float:
    """Return how far `t` is in the span: it begins and ends gently."""
    return smooth_step((t - span[0]) / seconds) * smooth_step((span[1] - t) / seconds)


@cache
def document() -> dict[str, Any]:
    """Return the file's content."""
    return dict(yaml.safe_load(FILE.read_text()))


@cache
def walker(number: int, height_m: float) -> Walker:
    """Return the round of person `number` (from 0), whose height sets the length of its steps."""
    described = document()["people"][number]
    way, round_s = described["way"], float(described["round_s"])
    steps = round(round_s * RATE_HZ)
    t = np.arange(steps) / RATE_HZ
    stamps = np.array([row[0] for row in way])
    places = np.array([row[1:3] for row in way], float)
    line = np.column_stack([np.interp(t, stamps, places[:, k], period=round_s) for k in (0, 1)])
    at = gaussian_filter1d(line, SMOOTH_S * RATE_HZ, axis=0, mode="wrap")
    velocity = (np.roll(at, -1, axis=0) - np.roll(at, 1, axis=0)) * RATE_HZ / 2
    speed = np.linalg.norm(velocity, axis=1)
    looks = _looks(way, round_s, t, velocity, speed)
    swing = np.maximum(np.minimum(speed / BRISK_M_S, 1.0), 0.3)
    phase = np.concatenate([[0.0], np.cumsum(2 * np.pi * speed / RATE_HZ / (STRIDE * height_m * swing))])
    phase *= 2 * np.pi * max(1, round(phase[-1] / (2 * np.pi))) / phase[-1]
    samples = np.column_stack([at, looks, speed])
    return Walker(
        round_s,
        np.concatenate([samples, samples[:1]]),
        phase,
        tuple((float(a), float(b)) for a, b in described.get("sits", ())),
        tuple((float(a), float(b)) for a, b in described.get("carries", ())),
    )


def _looks(way: list[list[float]], round_s: float, t: Array, velocity: Array, speed: Array) -> Array:
    """Return unit vectors (n x 2) of where one looks: ahead in walking, where the way says in standing."""
    moving = speed > 0.25
    ahead = velocity / np.maximum(speed, 1e-9)[:, None]
    stands = [row for row in way if len(row) > 3]
    if stands:
        stamps = np.array([row[0] for row in stands])
        away = (t[:, None] - stamps[None, :] + round_s / 2) % round_s - round_s / 2
        yaw = np.radians([stands[k][3] for k in np.abs(away).argmin(axis=1)])
        ahead = np.where(moving[:, None], ahead, np.column_stack([np.cos(yaw), np.sin(yaw)]))
    else:
        last = np.maximum.accumulate(np.where(moving, np.arange(len(t)), 0))
        ahead = ahead[last]
    turns = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    once_round = 2 * np.pi * np.round((turns[-1] - turns[0]) / (2 * np.pi)) * t / round_s
    heading = gaussian_filter1d(turns - once_round, TURN_S * RATE_HZ, mode="wrap") + once_round
    return np.column_stack([np.cos(heading), np.sin(heading)])


def carton_place(walks: Walker, T_world_held: Array, t: float) -> tuple[Array, bool]:
    """Return T_world_carton at `t` seconds, and whether it is off its place; `T_world_held` is in the person's arms."""
    rounds, now = divmod(t, walks.round_s)
    places = [_standing(row) for row in document()["carton"]]
    done = int(rounds) * len(walks.carries) + sum(now > end for _, end in walks.carries)
    before, after = places[done % len(places)], places[(done + 1) % len(places)]
    span = next((span for span in walks.carries if span[0] < now <= span[1]), None)
    if span is None:
        return before, False
    rests = before if now - span[0] < span[1] - now else after
    return between(rests, T_world_held, _within(now, span, GRASP_S)), True


def _standing(row: list[float]) -> Array:
    x, y, z, yaw_deg = row
    a = np.deg2rad(yaw_deg)
    return np.array([[np.cos(a), -np.sin(a), 0, x], [np.sin(a), np.cos(a), 0, y], [0, 0, 1, z], [0, 0, 0, 1.0]])


def between(T_a: Array, T_b: Array, share: float) -> Array:
    """Return the pose `share` of the way from `T_a` to `T_b`: straight, and turning evenly."""
    from odom.geometry.se3 import so3_exp, so3_log

    T = np.eye(4)
    T[:3, :3] = T_a[:3, :3] @ so3_exp(share * so3_log(T_a[:3, :3].T @ T_b[:3, :3]))
    T[:3, 3] = (1 - share) * T_a[:3, 3] + share * T_b[:3, 3]
    return T
