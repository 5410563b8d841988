"""Formats of exported friction: one a file, whose name is that of the format."""
