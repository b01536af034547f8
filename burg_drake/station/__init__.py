"""Stations (robot, table, cameras) and the one place that builds Drake diagrams.

Read `document` first, then `diagram.builder`, which puts together what `world` adds to a plant and
`control` to a diagram.
"""
