"""Stations (robot, table, cameras) and the one place that builds Drake diagrams.

Read `station_document` first, then `diagram_builder`: it puts together what `robot`,
`surroundings`, `object_bodies` and `contact_parts` add to a plant, and `ports` and
`camera_sensors` to a diagram.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
