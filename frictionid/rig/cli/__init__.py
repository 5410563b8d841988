"""Commands of camera, clocks and drive."""
