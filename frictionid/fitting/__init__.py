"""From a problem to a fit: methods, parameters, identifiers."""
