"""What is predicted of each reading under a set of effects, at depth edges and off them."""
