"""What is given is used or refused for a reason: the figures of report and summary add up."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from painted_wall import CAMERA, write_wall

from odom.cli.summary import summary
from odom.frame import Stamp
from odom.service.input_report import source_report, with_source
from odom.wire import Topics
from odom.wire.assembler import FrameAssembler
from odom.wire.codec import encode_color, encode_depth
from odom.wire.message import Message

Start = Callable[..., "subprocess.Popen[str]"]
TOPICS = Topics()
PERIOD_NS = 33_333_333
COLOR, DEPTH = np.zeros((4, 6, 3), np.uint8), np.ones((4, 6), np.uint16)


@st.composite
def images(draw: st.DrawFn) -> list[Message]:
    """Colour and depth images of two streams: some are missing, late, stamped twice, of another size, or garbage."""
    messages = []
    for i in range(draw(st.integers(0, 40))):
        for encode, key, image in (
            (encode_color, TOPICS.color, COLOR),
            (encode_depth, TOPICS.depth, DEPTH),
        ):
            kind = draw(
                st.sampled_from(["good", "good", "good", "good", "missing", "garbage", "small", "again", "leap"])
            )
            stamp = 10**18 + i * PERIOD_NS + draw(st.integers(-PERIOD_NS // 2, PERIOD_NS // 2))
            stamp += {"again": -PERIOD_NS, "leap": 3_000_000_000}.get(kind, 0)
            message = encode(key, Stamp(stamp), image[:2, :4] if kind == "small" else image)
            if kind == "garbage":
                message = Message(key, message.type_name, message.stamp, b"\0\1\0\0")
            messages += [] if kind == "missing" else [message]
    return messages


@given(images())
def test_every_image_that_comes_is_used_or_refused_for_a_reason(messages: list[Message]) -> None:
    assembler = FrameAssembler(TOPICS)
    frames = [frame for message in messages for frame in assembler.feed(message)]
    frames += assembler.finish()
    for counts, key in ((assembler.pairing.color, TOPICS.color), (assembler.pairing.depth, TOPICS.depth)):
        assert counts.given == sum(message.topic == key for message in messages)
        assert counts.given == counts.used + counts.refused.total()
    assert assembler.pairing.color.used == len(frames)
    assert assembler.pairing.depth.used == sum(bool(frame.depth_mm.any()) for frame in frames)


counts = st.integers(0, 50)


@given(counts, counts, counts, counts, counts)
def test_what_the_sensor_left_out_and_what_did_not_arrive_are_in_the_sum(
    used: int, refused: int, left_out: int, missing: int, underway: int
) -> None:
    sent = used + refused + underway
    report = {
        "frames": used, "tracked": used // 2, "completeness": None,
        "colour": {"given": used + refused, "used": used, "refused": {"cannot be read": refused}},
        "depth": {"given": 7, "used": 7, "refused": {}},
    }  # fmt: skip
    source = source_report(sent, sent + left_out + missing, True, {("colour", "no such file"): left_out}, ["cut"])
    whole = with_source(report, json.loads(json.dumps(source)))
    color = whole["colour"]
    assert color["given"] == sent + left_out + missing == color["used"] + sum(color["refused"].values())
    assert whole["completeness"] == (round(whole["tracked"] / color["given"], 4) if color["given"] else None)
    assert whole["depth"] == report["depth"]
    assert whole["source_damage"] == ["cut"]
    assert next(iter(summary(whole, Path()))).startswith(f"{used // 2} of {color['given']} frames tracked")


def test_a_run_over_a_broken_folder_says_what_became_of_every_image(odom: Start, tmp_path: Path) -> None:
    folder, out = write_wall(tmp_path / "wall", frames=60), tmp_path / "out"
    (folder / "camera.yaml").write_text(CAMERA)
    for i in range(5):
        (folder / "rgb" / f"{10 + i:03}.png").unlink()
        (folder / "rgb" / f"{30 + i:03}.png").write_bytes(b"no picture")
    for i in range(9):
        (folder / "depth" / f"{45 + i:03}.png").unlink()
    (folder / "groundtruth.txt").write_text("100 nan 0 0 0 0 0 1\n" * 60)
    run = odom("run", folder, "--headless", "--out", out)
    words, _ = run.communicate(timeout=120)
    assert run.returncode == 0, words
    report = json.loads((out / "report.json").read_text())
    assert report["colour"] == {"given": 60, "used": 50, "refused": {"no such file": 5, "damaged file": 5}}
    assert report["depth"] == {"given": 60, "used": 41, "refused": {"no colour image beside it": 10, "no such file": 9}}
    assert report["frames"] == 50
    assert report["unmatched_frames"] == 9
    assert f"{report['tracked']} of 60 frames tracked ({report['tracked'] / 60:.1%})" in words
    assert "colour images: 50 of 60 used; not used: 5 no such file, 5 damaged file" in words
    assert "9 frames had no depth image beside them; they are used all the same" in words
    assert words.count("left out") == 5  # the first of each kind, and the counts
    counts = "5 of colour (damaged file), 5 of colour (no such file), 9 of depth (no such file), 60 of truth (no pose)"
    assert report["source_damage"] == [f"left out {counts}"]


@pytest.mark.parametrize("stream", ["colour", "depth"])
def test_what_is_refused_is_summed_up_in_one_line(stream: str) -> None:
    report = {
        "frames": 7,
        "tracked": 7,
        stream: {"given": 60, "used": 7, "refused": {"no such file": 50, "damaged file": 3}},
    }
    lines = list(summary(report, Path()))
    assert f"{stream} images: 7 of 60 used; not used: 50 no such file, 3 damaged file" in lines
