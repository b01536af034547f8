"""Generator of `models/ur5e`: `python -m tools.ur5e_model`."""
