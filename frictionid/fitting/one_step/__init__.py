"""One-step problems: friction enters affinely."""
