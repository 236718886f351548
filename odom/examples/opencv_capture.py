"""Odometry of a depth camera read by OpenCV; without one, of a recording. Arguments: [RECORDING]."""

import sys
import time
from collections.abc import Iterator

import cv2
import numpy as np

import odom


def captured(capture: cv2.VideoCapture) -> Iterator[odom.RgbdFrame]:
    """Yield the frames of an OpenNI2 camera until it ends; OpenCV's colour is BGR, its depth uint16 millimetres."""
    for sequence, _ in enumerate(iter(capture.grab, False)):
        stamp = odom.Stamp(time.time_ns())
        has_color, bgr = capture.retrieve(flag=cv2.CAP_OPENNI_BGR_IMAGE)
        has_depth, depth_mm = capture.retrieve(flag=cv2.CAP_OPENNI_DEPTH_MAP)
        if has_color and has_depth:
            rgb = np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), np.uint8)
            yield odom.RgbdFrame(sequence, stamp, rgb, stamp, np.asarray(depth_mm, np.uint16))


capture = cv2.VideoCapture(0, cv2.CAP_OPENNI2)
capture.set(cv2.CAP_PROP_OPENNI_REGISTRATION, 1)  # depth registered to colour
recording = None if capture.isOpened() else odom.read_recording(*sys.argv[1:] or ["recordings/arena.mcap"])
camera = recording.camera if recording else odom.Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
odometry = odom.Odometry(camera)
for estimate in map(odometry.process, recording or captured(capture)):
    print(estimate.state.value, None if estimate.T_odom_camera is None else estimate.T_odom_camera[:3, 3].round(3))
