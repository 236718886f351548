"""Programs of at most 30 lines to start from. Run one as `python -m odom.examples.numpy_frames`."""
