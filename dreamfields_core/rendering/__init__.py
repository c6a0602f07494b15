"""From a field to pictures: where to sample, what to skip, how to composite (paper section 3.1)."""
