"""The simulated camera: a scene, a view of it, and videos."""
