"""Health monitoring: whether friction has changed since the recordings of a baseline."""
