"""Stations (robot, table, cameras) and the one place that builds Drake diagrams.

Read `document` first, then `diagram.builder`, which puts together what `world` adds to a plant and
`control` to a diagram.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
