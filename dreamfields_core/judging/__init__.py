"""Is it what was asked for? Retrieval of the caption from pictures (paper section 5.1)."""
