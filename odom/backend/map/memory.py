"""Which key frames of a saved map are in memory: brought back when the camera comes near, set aside when it is far.

A key frame that is set aside keeps its pose, registrations, links and the entries of its place, some 20 kB; landmarks,
measurements and the place itself are fetched again.
"""

from bisect import insort
from collections.abc import Iterable

import numpy as np

from odom.backend.map.journal import Journal
from odom.backend.map.keyframe import Keyframe
from odom.backend.map.map import Map
from odom.backend.map.saved import MapChanges, SavedDetails, SavedKeyframe, SavedLandmarks, SavedMap
from odom.backend.map.shape_covariance import shape_covariances
from odom.backend.map.tuning import TUNING
from odom.frontend.features.place_descriptor import Place
from odom.geometry import se3
from odom.geometry.arrays import Array, Index, rounded


def open_map(saved: SavedMap) -> Map:
    """Return the map that was saved, with all key frames set aside.

    In a fixed one, key frames have the covariance of their places in the whole map (see `shape_covariances`).
    """
    map_ = Map(details=saved.details)
    map_.places.blocks, map_.places.elsewhere = saved.blocks, saved.details.fetch_place
    map_.landmarks.next_identity = saved.next_identity
    map_.session = saved.session
    for one in saved.keyframes:
        keyframe = Keyframe.set_aside(one.number, one.stamp, one.segment, one.T_camera_map, one.T_middle_stamp)
        keyframe.first = one.number if saved.is_fixed else one.first
        keyframe.covariance_since_start = one.covariance_since_start
        keyframe.session = one.session
        map_.keyframes.append(keyframe)
        map_.links.append(set())
        for other in one.links:
            map_.link(one.number, other)
    for edge in saved.edges:
        map_.registrations.add(edge)
        map_.link(edge.a, edge.b)
    if saved.is_fixed:
        everywhere = np.ones(len(map_.keyframes), dtype=np.bool_)
        poses = np.array([k.T_camera_map for k in map_.keyframes]).reshape(-1, 4, 4)
        shape = shape_covariances(poses, map_.registrations.table.among(everywhere))
        for keyframe, covariance in zip(map_.keyframes, shape, strict=True):
            keyframe.covariance_since_start = covariance
    map_.away = set(range(len(saved.keyframes)))
    map_.earlier_keyframes = len(saved.keyframes)
    map_.journal = map_.registrations.journal = Journal(is_kept=not saved.is_fixed)
    return map_


def details_of(map_: Map, number: int) -> SavedDetails:
    """Return what is to be saved of a key frame that is in memory; landmarks of vague depth are not.

    It is rounded as a file keeps it, so that it is the same to the bit whether it is brought back from disk or sooner.
    """
    keyframe, L = map_.keyframes[number], map_.landmarks
    rows = np.flatnonzero(L.alive & (L.keyframe == number))
    rows = rows[~L.is_vague(rows)]
    T, R = keyframe.T_camera_map, keyframe.T_camera_map[:3, :3]
    covariance = R @ L.covariance[rows] @ R.T
    landmarks = SavedLandmarks(
        L.identity[rows],
        se3.apply(T, L.position[rows]),
        rounded(0.5 * (covariance + covariance.swapaxes(1, 2))),
        L.uv[rows],
        rounded(L.plane[rows]),
        L.patch_full[rows],
        L.patch_half[rows],
        L.seen[rows],
        L.tried[rows],
        L.assumed[rows],
    )
    place = map_.places.places.get(number) or _saved_place(map_, number)
    return SavedDetails(
        keyframe.timing,
        keyframe.identities,
        keyframe.uv,
        keyframe.measurements.rounded(),
        landmarks,
        None if place is None else place.rounded(),
    )


def _saved_place(map_: Map, number: int) -> Place | None:
    return None if map_.details is None else map_.details.fetch_place(number)


def recall(map_: Map, numbers: Iterable[int]) -> bool:
    """Bring key frames that were set aside back into memory; return whether there were any.

    Those that cannot be read are noted as `unreadable`, and not tried again by `recall_near`.
    """
    L, details, recalled = map_.landmarks, map_.details, []
    for number in sorted(map_.away.intersection(numbers)):
        pending = map_.journal.set_aside.pop(number, None)
        found = pending or (details.fetch(number) if details is not None else None)
        if found is None:
            map_.unreadable.add(number)
            continue
        if pending is not None:
            map_.journal.note_new_details([number])
        keyframe, own = map_.keyframes[number], found.landmarks
        T_map_camera = se3.inverse(keyframe.T_camera_map)
        R = T_map_camera[:3, :3]
        rows = L.add(
            se3.apply(T_map_camera, own.position),
            R @ own.covariance @ R.T,
            number,
            own.uv,
            own.plane,
            own.patch_full,
            own.patch_half,
            own.identity,
        )
        L.seen[rows], L.tried[rows], L.assumed[rows] = own.seen, own.tried, own.assumed
        keyframe.identities, keyframe.uv, keyframe.timing = found.identities.copy(), found.uv, found.timing
        keyframe.measurements = found.measurements
        keyframe.rows = np.zeros(len(found.identities), dtype=np.int64)
        map_.away.discard(number)
        insort(map_.remembered, number)
        recalled.append(number)
    if recalled:
        _bind(map_, set(recalled).union(*(map_.links[n] for n in recalled)) - map_.away)
    return bool(recalled)


def recall_near(map_: Map, keyframe: int, T_camera_map: Array, at_once: int = TUNING.recalled) -> bool:
    """Bring back up to `at_once` of the key frames around `keyframe` that are nearest to a pose; return as `recall`."""
    around = map_.around(keyframe, TUNING.recalled) - map_.unreadable
    missing = map_.away & around
    if not missing:
        return False
    nearest = map_.nearest(sorted(around), T_camera_map)[: TUNING.recalled]
    wanted = [n for n in dict.fromkeys([keyframe, *nearest.tolist()]) if n in missing]
    if map_.details is not None:
        map_.details.expect(wanted[at_once:])
    return recall(map_, wanted[:at_once])


def expect_around(map_: Map, keyframes: Iterable[int]) -> None:
    """Begin to read from disk those set aside that were made right before and after the given key frames."""
    if map_.details is not None:
        half = TUNING.recalled // 2
        near = [n for k in keyframes for n in range(k - half, k + half + 1) if n in map_.away]
        map_.details.expect([n for n in near if n not in map_.unreadable])


def farthest_beyond(map_: Map, most: int, needed: Index, T_camera_map: Array | None) -> list[int]:
    """Return the key frames to set aside so that `most` remain: the farthest from a pose, without those `needed`."""
    surplus = len(map_.remembered) - most
    free = sorted(set(map_.remembered).difference(needed.tolist()))
    if surplus <= 0 or not free:
        return []
    if T_camera_map is not None:
        free = map_.nearest(free, T_camera_map)[::-1].tolist()
    return free[:surplus]


def _bind(map_: Map, numbers: set[int]) -> None:
    """Let key frames point to the rows in which the landmarks that they measured are now."""
    L = map_.landmarks
    alive = np.flatnonzero(L.alive)
    order = alive[np.argsort(L.identity[alive])]
    sorted_identities = L.identity[order]
    for keyframe in (map_.keyframes[n] for n in sorted(numbers)):
        if not len(order):
            keyframe.forget()
            continue
        at = np.minimum(np.searchsorted(sorted_identities, keyframe.identities), len(order) - 1)
        is_there = sorted_identities[at] == keyframe.identities
        keyframe.rows = np.where(is_there, order[at], keyframe.rows)


def set_aside(map_: Map, number: int) -> None:
    """Drop from memory what a key frame measured; what was not saved of it goes to the journal.

    Its place is then still known, until the changes are taken (see `take_changes`).
    """
    keyframe, L, journal = map_.keyframes[number], map_.landmarks, map_.journal
    if number in journal.with_new_details or number in journal.with_fewer_landmarks:
        journal.set_aside[number] = details_of(map_, number)
        journal.with_new_details.discard(number)
        journal.with_fewer_landmarks.discard(number)
    else:
        map_.places.set_aside(number)
    L.cull(np.flatnonzero(L.alive & (L.keyframe == number)))
    keyframe.forget()
    map_.remembered.remove(number)
    map_.away.add(number)


def take_changes(map_: Map) -> MapChanges:
    """Return what has changed since the last call; nothing for a map that is not saved."""
    journal = map_.journal
    if not journal.is_kept:
        return MapChanges()
    details = {n: details_of(map_, n) for n in sorted(journal.with_new_details) if n not in map_.away}
    changes = MapChanges(
        tuple(saved_keyframe(map_, n) for n in sorted(journal.new_or_moved)),
        tuple(map_.registrations.between(a, b) for a, b in sorted(journal.registrations)),
        details | journal.set_aside,
        map_.landmarks.next_identity,
        poses={n: map_.keyframes[n].T_camera_map for n in journal.moved_only - journal.new_or_moved},
    )
    for number in journal.set_aside:
        map_.places.set_aside(number)
    journal.clear()
    return changes


def saved_keyframe(map_: Map, number: int) -> SavedKeyframe:
    """Return what is to be saved of a key frame's pose and links."""
    k = map_.keyframes[number]
    links = tuple(sorted(n for n in map_.links[number] if n < number))
    T, T_middle_stamp, covariance = (_copy(M) for M in (k.T_camera_map, k.T_middle_stamp, k.covariance_since_start))
    return SavedKeyframe(number, k.session, k.stamp, k.segment, k.first, T, T_middle_stamp, covariance, links)


def _copy(matrix: Array) -> Array:
    return np.array(matrix)
