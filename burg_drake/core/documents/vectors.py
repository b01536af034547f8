"""Types of a few numbers in documents."""

from __future__ import annotations

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
