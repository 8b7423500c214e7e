"""Where a kind of flaw may sit: the skin, feature edges, rims of holes."""
