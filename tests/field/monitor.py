"""Write down what arrives, `topic stamp_ns arrival_ns` a line, until ended: `monitor.py ENDPOINT FILE KEY...`."""

import sys
import time
from pathlib import Path

from odom.wire import WireSettings
from odom.wire.session import open_session


def main(endpoint: str, file: str, *keys: str) -> None:
    settings = WireSettings(mode="client", connect=(endpoint,))
    with open_session(settings) as session, Path(file).open("w", buffering=1) as out:
        subscriber = session.subscriber(keys, depth=100)
        print("listening", file=out)
        while True:
            delivery = subscriber.receive(1.0)
            if delivery is not None:
                print(delivery.message.topic, delivery.message.stamp, time.time_ns(), file=out)


if __name__ == "__main__":
    main(*sys.argv[1:])
