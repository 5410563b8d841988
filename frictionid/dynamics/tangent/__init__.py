"""Derivatives of the physics step."""
