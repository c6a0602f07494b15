"""What came of a sweep, for people: the table, the gallery, the learning curves and the failures as one page (paper section 5)."""
