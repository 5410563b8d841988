"""A fitted friction at work: simulators, and what cancels it in a controller."""
