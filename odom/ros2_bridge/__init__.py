"""A bridge between ROS 2 on Zenoh, where this project's processes are, and ROS 2 on DDS; raw bytes, both ways."""
