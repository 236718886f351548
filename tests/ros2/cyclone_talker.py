"""Two publishers of static transforms by Cyclone DDS, each with one, as two ROS nodes tell theirs; until killed.

Arguments: domain, and for each transform: parent, child, x (m).
"""

import sys
import time

from cyclone_listener import Header, Quaternion, TFMessage, Time, Transform, TransformStamped, Vector3
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic
from cyclonedds.util import duration


def main(domain: str, *transforms: str) -> None:
    qos = Qos(
        Policy.Durability.TransientLocal,
        Policy.Reliability.Reliable(duration(seconds=1)),
        Policy.History.KeepLast(1),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )
    kept = []
    for parent, child, x in zip(transforms[::3], transforms[1::3], transforms[2::3], strict=True):
        participant = DomainParticipant(int(domain))
        writer = DataWriter(participant, Topic(participant, "rt/tf_static", TFMessage), qos=qos)
        moved = Transform(Vector3(float(x), 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
        writer.write(TFMessage([TransformStamped(Header(Time(1, 2), parent), child, moved)]))
        kept.append(writer)
    time.sleep(1000)


main(*sys.argv[1:])
