"""The map: key frames, landmarks and the pose graph of their registrations."""
