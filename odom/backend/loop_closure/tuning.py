"""The tuned numbers of loop closure (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import in_use, tuned


@dataclass(frozen=True)
class Tuning:
    """Numbers by which closures are judged."""

    chain_sigma_scale: float = tuned(
        2.0,
        unit="1",
        effect="The sigmas of chain and closure are multiplied by this before they are compared. Smaller: true "
        "closures are refused; larger: false ones pass.",
        source="false recognitions in look-alike rooms of the arena",
    )
    closing_frames: int = tuned(
        2,
        unit="frames",
        effect="The background has so many to close loops, however small the map. Fewer: frames wait for it; more: "
        "loops are closed later.",
        source="4 ms of CPU for 400 key frames (tests/map_file/test_large_map.py), on a crowded machine",
    )
    closing_keyframes: int = tuned(
        300,
        unit="key frames a frame",
        effect="The background is given one frame more for so many key frames. Fewer: loops are closed later; more: "
        "frames wait for it.",
        source="30 to 75 us of CPU a key frame (tests/map_file/test_large_map.py): a third of the time that this gives",
    )
    most_waiting: int = tuned(
        100,
        unit="recognitions",
        effect="So many may wait while loops are closed. Fewer: some are lost in large maps; more: memory.",
        source="two key frames a second for the minute that 100,000 key frames take",
    )
    most_put_off: int = tuned(
        5,
        unit="key frames",
        effect="So many that may look like other places wait until a frame has time for them. Fewer: frames that "
        "become key frames take longer; more: loops are closed later, and views wait in memory.",
        source="at 10 Hz four of ten frames of a walk are key frames",
    )
    kept_views: int = tuned(
        64,
        unit="key frames",
        effect="The views of so many that were in doubt are kept, to look for other segments at the end of a run. "
        "Fewer: segments stay apart; more: memory, 1 MB each, and .1 s each at the end of a run that fell apart.",
        source="three bodies painted into fr1_rpy: 40 to 60 key frames in 8 s",
    )
    join_least: int = tuned(
        3,
        unit="key frames",
        effect="Two maps are joined where so many of each agree. Fewer: a thing that was carried elsewhere joins "
        "them; more: short maps are not joined.",
        source="visits of the arena, where a thing that was moved makes up to 7 recognitions of 3 key frames",
    )
    join_seeds: int = tuned(
        5,
        unit="recognitions",
        effect="With each of so many, the surest ones, it is tried how many others agree. Fewer: all of them may be "
        "of a moved thing; more: it costs more.",
        source="visits of the arena, where one of 30 recognitions between two maps is of a moved thing",
    )
    join_alike: float = tuned(
        4.0,
        unit="1",
        effect="Recognitions of key frames that see the same things err alike: their covariances grow by this factor. "
        "Smaller: they bend maps that are surer than they are; larger: maps do not fit each other.",
        source="sweep over five visits of the arena, and fr1_xyz in three parts with fr1_rpy: of 1/4 to 64, the least "
        "error of each visit, and of all together",
    )
    join_near: float = tuned(
        2.0,
        unit="of the median distance of the recognised",
        effect="Key frames of two maps count as near up to this distance. Smaller: few do, and chance decides; "
        "larger: some of them see other things.",
        source="visits of the arena, where this is .6 m + rad and all but one or two of 40 key frames are nearer",
    )
    join_share: float = tuned(
        0.5,
        unit="share of key frames",
        effect="Of the key frames that are near (join_near), more than this share must be recognised. Smaller: "
        "look-alike rooms are joined; larger: a room in other light is not.",
        source="93 to 100 % between visits of one arena, 67 to 100 % between cuts of fr1_xyz, 10 to 34 % between "
        "arenas of other seeds, which are furnished alike",
    )


TUNING = in_use(Tuning)
