"""One labelled scan: readings, noise-free twins, labels."""
