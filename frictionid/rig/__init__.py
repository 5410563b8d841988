"""The rig: camera, clocks, drive, and their simulation."""
