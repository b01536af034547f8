"""Composing a scene by hand: document, selection, commands and history, without any page."""
