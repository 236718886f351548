"""Record the first OpenNI2 device with the library's own recorder: `record_oni.py FILE.oni SECONDS`."""

import sys
import time

from sensors.openni2 import library


def main(file: str, seconds: float) -> None:
    api = library.load()
    device = api.Device(None)
    streams = [device.create_color_stream(), device.create_depth_stream()]
    for stream in streams:
        stream.set_mirroring_enabled(False)
    recorder = api.Recorder(file.encode())
    for stream in streams:
        recorder.attach(stream)
        stream.start()
    recorder.start()
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if (stream := api.wait_for_any_stream(streams, 0.2)) is not None:
            stream.read_frame().close()
    recorder.stop()
    for stream in streams:
        stream.stop()
    recorder.close()


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
