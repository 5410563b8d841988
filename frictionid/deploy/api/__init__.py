"""Public functions on fitted models in use."""
