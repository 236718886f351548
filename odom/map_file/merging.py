"""Merges maps of several days: the places of each are looked up in the others, and recognitions that agree join them.

The maps are taken in the order in which their first sessions began, so that it does not matter how they are named or
listed; nothing else depends on a clock, on chance or on what the files are called.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from itertools import chain
from pathlib import Path

from odom.backend.loop_closure.joining import Joined, join_parts
from odom.backend.map.memory import open_map, saved_keyframe
from odom.backend.map.pose_graph import Edge
from odom.backend.map.saved import SavedKeyframe, SavedMap
from odom.errors import ConfigError, MapError
from odom.frame import Camera
from odom.frontend.camera.noise_monitor import NoiseMonitor
from odom.frontend.matching.place_recognition import PlaceIndex, recognise
from odom.map_file.map_file import MapFile
from odom.map_file.new_map import Gathered, Origin, refuse_to_replace, renumbered, write_new
from odom.map_file.sessions import Session, is_same_camera


@dataclass(frozen=True, eq=False)
class _Part:
    """An opened map and where its numbers begin in the merged one."""

    opened: MapFile
    saved: SavedMap
    sessions: tuple[Session, ...]
    keyframe: int
    session: int
    segment: int
    identity: int


def merge(opened: Sequence[MapFile], out: Path) -> Joined:
    """Write the map `out` of all sessions of the `opened` ones; return what joined them.

    Of what the maps have learnt of the camera's timing and noise, the newest session's is kept. Raises ConfigError
    where there is a file `out` already or the maps are not of one camera, MapError where one is damaged or two hold
    the same key frames.
    """
    refuse_to_replace(out)
    parts = _numbered(opened)
    _refuse_common_keyframes(parts)
    newest = max(parts, key=lambda part: part.sessions[-1].begun)
    merged = _side_by_side(parts, newest)
    recognised = list(chain.from_iterable(_recognised(parts, k, merged) for k in range(len(parts))))
    joined, merged = _joined(merged, recognised)
    sessions = [replace(s, number=p.session + s.number) for p in parts for s in p.sessions]
    write_new(out, sessions, merged)
    return joined


def _numbered(opened: Sequence[MapFile]) -> list[_Part]:
    """Return the maps that hold anything, ordered by their beginnings, or by their contents where these are equal.

    The numbers of each follow those of the one before.
    """
    ordered = sorted((one for one in opened if one.sessions()), key=lambda one: (one.sessions()[0].begun, one.digest()))
    if len(ordered) < 2:
        raise ConfigError("merging takes two maps that hold anything: give two or more")
    camera = _common_camera(ordered)
    parts: list[_Part] = []
    keyframe = session = segment = identity = 0
    for one in ordered:
        saved, sessions = one.begin(camera), tuple(one.sessions())
        parts.append(_Part(one, saved, sessions, keyframe, session, segment, identity))
        keyframe += len(saved.keyframes)
        session += 1 + sessions[-1].number
        segment += 1 + max((k.segment for k in saved.keyframes), default=-1)
        identity += saved.next_identity - 1
    return parts


def _common_camera(ordered: Sequence[MapFile]) -> Camera:
    """Return the calibration of the first session; raises ConfigError where another one's differs by a pixel."""
    first = ordered[0].sessions()[0].camera
    for one in ordered:
        for session in one.sessions():
            if not is_same_camera(session.camera, first):
                raise ConfigError(
                    f"{ordered[0].path} and {one.path} were made with different cameras, {first} and {session.camera}: "
                    "give maps of one camera"
                )
    return first


def _refuse_common_keyframes(parts: Sequence[_Part]) -> None:
    """Raise MapError where two maps hold the same key frames: one is a copy of the other, perhaps extended."""
    seen: dict[bytes, _Part] = {}
    for part in parts:
        for k in part.saved.keyframes:
            place = part.opened.fetch_place(k.number)
            if place is None or not len(place.descriptors):
                continue
            before = seen.setdefault(sha256(place.descriptors.tobytes()).digest(), part)
            if before is not part:
                raise MapError(
                    f"{before.opened.path} and {part.opened.path} hold the same key frames: one is a copy of the "
                    "other, or goes on in a copy; leave one of them out"
                )


def _side_by_side(parts: Sequence[_Part], newest: _Part) -> SavedMap:
    """Return the map of all key frames under new numbers; nothing joins the maps yet."""
    keyframes: list[SavedKeyframe] = []
    edges: list[Edge] = []
    origins: list[Origin] = []
    for part in parts:
        new = {k.number: part.keyframe + k.number for k in part.saved.keyframes}
        for k in part.saved.keyframes:
            session, segment = part.session + k.session, part.segment + k.segment
            keyframes.append(replace(renumbered(k, new), session=session, segment=segment))
        edges += [replace(e, a=new[e.a], b=new[e.b]) for e in part.saved.edges]
        origins += [Origin(part.opened, number, part.identity) for number in new]
    next_identity = parts[-1].identity + parts[-1].saved.next_identity
    sensor = newest.saved.sensor
    return SavedMap(tuple(keyframes), tuple(edges), Gathered(origins), next_identity=next_identity, sensor=sensor)


def _recognised(parts: Sequence[_Part], later: int, merged: SavedMap) -> Iterator[Edge]:
    """Yield the registrations of one map's places with those of the maps before it that they look like."""
    part, noise = parts[later], _noise(merged)
    scale = 1.0 if noise is None else noise.covariance_scale
    indices = [
        (earlier, PlaceIndex(blocks=earlier.saved.blocks, elsewhere=earlier.opened.fetch_place))
        for earlier in parts[:later]
    ]
    for k in part.saved.keyframes if indices else ():
        place = part.opened.fetch_place(k.number)
        if place is None:
            continue
        for earlier, index in indices:
            for recognition in recognise(index, place, set()):
                registration = recognition.registration
                if registration is None or recognition.refusal:
                    continue
                a, b = earlier.keyframe + recognition.candidate, part.keyframe + k.number
                yield Edge(a, b, registration.T_target_source, registration.covariance * scale)


def _noise(merged: SavedMap) -> NoiseMonitor | None:
    if merged.sensor is None:
        return None
    memory = merged.sensor
    return replace(
        NoiseMonitor.of(memory.noise),
        inflation_by_halves=memory.inflation_by_halves,
        inflation_by_jumps=memory.inflation_by_jumps,
    )


def _joined(merged: SavedMap, recognised: Sequence[Edge]) -> tuple[Joined, SavedMap]:
    noise = _noise(merged)
    map_ = open_map(merged)
    joined = join_parts(map_, recognised, 0.0 if noise is None else noise.calibration_error)
    numbers = range(len(merged.keyframes))
    edges = sorted(map_.registrations.among(numbers), key=lambda e: (min(e.a, e.b), max(e.a, e.b)))
    keyframes = tuple(saved_keyframe(map_, n) for n in numbers)
    return joined, replace(merged, keyframes=keyframes, edges=tuple(edges))
