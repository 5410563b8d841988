"""Readers: one format per file, each from the bytes of a file to checked arrays."""
