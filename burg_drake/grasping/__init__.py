"""Grasp sampling and the screen of the open hand against the scene."""
