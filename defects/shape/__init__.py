"""What kinds of flaws are built of: outlines, paths over the skin, patches of it, edge sections."""
