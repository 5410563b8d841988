"""Commands on fitted models in use."""
