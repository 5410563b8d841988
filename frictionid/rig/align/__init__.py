"""Synchronise the clocks of angles and torque, by the motion itself or by a sync LED."""
