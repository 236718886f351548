"""SIFT3D key points and CSHOT descriptors of coloured clouds, as the paper's physical experiment uses them; optional.

Not for real time: a Kinect's cloud takes about a second. The odometry itself follows corners in images.
"""
