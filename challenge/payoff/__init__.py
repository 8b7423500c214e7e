"""Does a diagnosis help in the end? One flaw segmenter, trained on three kinds of data."""
