"""The live view's page and its server."""
