"""Meshcat views: scenes, grasps coloured by outcome, replays."""
