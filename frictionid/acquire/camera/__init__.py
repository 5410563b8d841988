"""From pictures of coloured dots to joint angles with their accuracy."""
