"""What only the training of networks needs."""
