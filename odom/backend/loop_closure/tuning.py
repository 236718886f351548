"""The tuned numbers of loop closure (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import in_use, tuned


@dataclass(frozen=True)
class Tuning:
    """Numbers by which closures are judged."""

    chain_sigma_scale: float = tuned(
        2.0,
        unit="1",
        effect="sigmas of chain and closure count so much; smaller: true closures are refused; larger: false ones pass",
        source="false recognitions in look-alike rooms of the arena",
    )
    closing_frames: int = tuned(
        2,
        unit="frames",
        effect="that closing loops may take in the background, however small the map; fewer: frames wait for it; more: "
        "loops are closed later",
        source="4 ms of CPU for 400 key frames (tests/map_file/test_large_map.py), on a crowded machine",
    )
    closing_keyframes: int = tuned(
        300,
        unit="key frames a frame",
        effect="that the background is trusted to close; more: frames wait for it; fewer: loops are closed later",
        source="30 to 75 us of CPU a key frame (tests/map_file/test_large_map.py): a third of the time that this gives",
    )
    most_waiting: int = tuned(
        100,
        unit="recognitions",
        effect="that may wait while loops are closed; fewer: some are lost in large maps; more: memory",
        source="two key frames a second for the minute that 100,000 key frames take",
    )
    most_put_off: int = tuned(
        5,
        unit="key frames",
        effect="that may look like other places until a frame has time for them; fewer: frames that are key frames "
        "take longer; more: loops are closed later, and views wait in memory",
        source="at 10 Hz four of ten frames of a walk are key frames",
    )
    kept_views: int = tuned(
        64,
        unit="key frames",
        effect="in doubt whose views are kept for the end of a run, to look for other segments; fewer: segments stay "
        "apart; more: memory, 1 MB each, and .1 s each at the end of a run that fell apart",
        source="three bodies painted into fr1_rpy: 40 to 60 key frames in 8 s",
    )
    join_least: int = tuned(
        3,
        unit="key frames",
        effect="of each of two maps that must agree; fewer: a thing carried elsewhere joins them; more: short ones are "
        "not joined",
        source="visits of the arena, where a thing that was moved makes up to 7 recognitions of 3 key frames",
    )
    join_seeds: int = tuned(
        5,
        unit="recognitions",
        effect="surest ones with which the others may agree; fewer: all may be of a moved thing; more: slower",
        source="visits of the arena, where one of 30 recognitions between two maps is of a moved thing",
    )
    join_near: float = tuned(
        2.0,
        unit="of the median distance of the recognised",
        effect="within it key frames of two maps must recognise each other; smaller: few do, by chance; larger: they "
        "see other things",
        source="visits of the arena, where this is .6 m + rad and all but one or two of 40 key frames are nearer",
    )
    join_share: float = tuned(
        0.5,
        unit="share of key frames",
        effect="of those so near that must be recognised; smaller: look-alike rooms are joined; larger: a room in "
        "other light is not",
        source="93 to 100 % between visits of one arena, 67 to 100 % between cuts of fr1_xyz, 10 to 34 % between "
        "arenas of other seeds, which are furnished alike",
    )


TUNING = in_use(Tuning)
