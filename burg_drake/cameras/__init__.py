"""Cameras: intrinsics, the board's pose from an image, overlay, placement check, image sources."""
