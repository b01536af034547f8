"""Scenes as documents of simulators: SDFormat, Drake's model directives, MJCF, USD."""
