"""Readers of files, one format per module. Readers convert units on loading."""
