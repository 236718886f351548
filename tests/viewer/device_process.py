"""A made-up device on the wire, live, with history: `device_process.py ENDPOINT FRAMES RATE_HZ [now [KEYFRAME_EVERY]]`.

It waits until somebody watches unless told otherwise, says so, and stays a while after its last frame.
"""

import sys
import threading
import time

from made_up_device import MadeUp, estimates, messages

from odom.backend import State
from odom.service.estimate_publisher import EstimatePublisher
from odom.service.settings import ServiceSettings
from odom.wire import Topics, WireSettings, codec
from odom.wire.session import open_session


def main(endpoint: str, frames: str, rate_hz: str, waits: str = "wait", keyframe_every: str = "15") -> None:
    topics, options = Topics("cam0"), MadeUp(frames=int(frames), keyframe_every=int(keyframe_every))
    watched = threading.Event()
    with open_session(WireSettings(connect=(), listen=(endpoint,))) as session:
        sensor = session.publisher()
        publisher = EstimatePublisher(session, topics, ServiceSettings())
        session.watch(topics.alive_of("viewer"), lambda key, alive: watched.set() if alive else None)
        print("ready", flush=True)
        if waits == "wait":
            watched.wait(60)
        begun, slowest = time.monotonic(), 0.0
        for i, (estimate, batch) in enumerate(zip(estimates(options), messages(options, topics), strict=True)):
            time.sleep(max(0.0, begun + i / float(rate_hz) - time.monotonic()))
            before = time.monotonic()
            for message in batch:
                if message.topic.startswith("truth/"):
                    publisher.remember_truth(options.body, codec.decode_pose(message))
                if message.topic.startswith("truth/") or "/color/" in message.topic or "/depth/" in message.topic:
                    sensor.put(message)
            publisher.publish_pose(estimate)
            publisher.publish_loops(estimate.loops)
            publisher.publish_display(estimate)
            for cloud in batch:
                if cloud.topic == topics.keyframes:
                    publisher.publish_keyframe(lambda cloud=cloud: cloud)
            if publisher.status_is_due(State.TRACKING):
                values = {"state": "TRACKING", "inliers": "150", "processing_ms": "9"}
                publisher.publish_status(State.TRACKING, "", values)
            slowest = max(slowest, time.monotonic() - before)
            if i % 30 == 0:
                print(f"frame {i}", flush=True)
        publisher.flush()
        sensor.put(codec.encode_text(topics.end, options.stamp(options.frames), "complete"))
        print(f"slowest {slowest:.4f}", flush=True)
        print("ended", flush=True)
        time.sleep(30)


if __name__ == "__main__":
    main(*sys.argv[1:])
