"""RGB-D odometry as a streaming service."""
