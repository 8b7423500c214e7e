"""Elements of kinds of flaws: outlines, paths over the skin, patches, edge sections."""
