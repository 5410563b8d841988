"""A simulated motor drive at a pseudo-terminal."""
