"""Executed grasp trials: phases, success criteria and margins."""
