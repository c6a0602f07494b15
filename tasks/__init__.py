"""One thin task for each step of the pipeline, over one caching rule."""
