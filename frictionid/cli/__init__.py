"""Commands, one per file; everything heavy is imported when a command runs."""
