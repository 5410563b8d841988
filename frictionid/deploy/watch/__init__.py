"""Watching a machine: the torque that its friction does not explain, in batches and live."""
