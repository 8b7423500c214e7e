"""Height maps in text: decoding, cells, words in headers, and the layouts of instruments."""
