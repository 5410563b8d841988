"""Programs of scalars: what a function of arrays does, written down once, for other languages."""
