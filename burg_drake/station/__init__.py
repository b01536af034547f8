"""Stations (robot, table, cameras) and the one place that builds Drake diagrams."""
