"""one_step."""
