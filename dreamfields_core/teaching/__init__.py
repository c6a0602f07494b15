"""A small captioned world, and the lessons that teach our own image-text models in it (no published weights, no network)."""
