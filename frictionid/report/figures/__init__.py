"""Pictures: one kind in each file."""
