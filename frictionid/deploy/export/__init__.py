"""Friction as code and files for simulators, controllers and drives, one format per file."""
