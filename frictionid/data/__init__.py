"""Measured data: signals, recordings, data sets and their readers, and estimated states."""
