"""Public functions on films and clocks."""
