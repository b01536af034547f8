"""Generator of `models/panda` and `models/hands/panda_hand.yaml`: `python -m tools.panda_model`."""
