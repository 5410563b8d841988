"""A virtual motor drive at a pseudo-terminal, for trying everything without hardware."""
