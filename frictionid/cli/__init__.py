"""Commands; everything heavy is imported when a command runs."""
