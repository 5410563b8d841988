"""Tables and pictures of monitoring and pooling."""
