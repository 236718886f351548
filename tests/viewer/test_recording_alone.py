"""A recording opened alone in Rerun shows images, depth, camera and poses."""

from pathlib import Path

from made_up_device import MadeUp, messages
from rerun.chunk import McapReader

from odom.wire import Topics, codec
from odom.wire.recording import RecordingWriter


def test_rerun_itself_understands_a_recording(tmp_path: Path) -> None:
    topics = Topics("cam0")
    path = tmp_path / "session.mcap"
    with RecordingWriter(path) as writer:
        for frame in messages(MadeUp(frames=20), topics):
            for message in frame:
                writer.write(message)
                if message.topic == topics.depth:
                    rvl = codec.encode_depth_compressed(
                        topics.depth_compressed, message.stamp, codec.decode_depth(message), codec="rvl"
                    )
                    writer.write(rvl)
    seen: dict[str, set[str]] = {}
    rows: dict[str, int] = {}
    for chunk in McapReader(path).stream():
        columns = chunk.to_record_batch().schema.names
        seen.setdefault(chunk.entity_path, set()).update(name.partition(":")[0] for name in columns)
        rows[chunk.entity_path] = rows.get(chunk.entity_path, 0) + chunk.num_rows
    assert "EncodedImage" in seen[f"/{topics.color_compressed}"]
    assert "DepthImage" in seen[f"/{topics.depth}"]
    assert "EncodedDepthImage" in seen[f"/{topics.depth_compressed}"]
    assert "Pinhole" in seen[f"/{topics.camera_info}"]
    assert {"InstancePoses3D", "Transform3D"} & seen[f"/{topics.pose}"]
    assert "Transform3D" in seen["/tf"]
    assert rows[f"/{topics.color_compressed}"] >= 20
