"""The physics step: what happens between two samples, stiction and zero crossings included."""
