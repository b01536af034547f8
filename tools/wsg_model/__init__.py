"""Generator of `models/wsg` and `models/hands/wsg_50.yaml`: `python -m tools.wsg_model`."""
