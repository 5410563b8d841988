"""From a table of recordings to a data set, a first verdict and a picture."""
