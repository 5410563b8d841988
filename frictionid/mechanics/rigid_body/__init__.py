"""Trees of rigid bodies: recursive algorithms over many samples at once, one per file."""
