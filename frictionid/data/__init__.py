"""What was measured: signals, recordings and data sets, states estimated from them; readers."""
