"""A fitted friction in use: export, compensation, simulation, monitoring, pooling."""
