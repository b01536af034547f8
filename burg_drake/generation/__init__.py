"""Scenes by the thousand: drawn from a recipe, settled, accepted or not, kept in a folder."""
