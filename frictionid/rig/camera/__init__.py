"""Joint angles and their standard deviations from pictures of coloured dots."""
