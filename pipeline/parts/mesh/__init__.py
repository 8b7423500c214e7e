"""From a mesh file to a closed solid: reading, mending, uniting bodies, thickening sheets."""
