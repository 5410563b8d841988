"""Sensitivity studies: what a wrong parameter, sensor or circumstance does to friction."""
