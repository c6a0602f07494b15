"""The optimisation of a field from a caption (paper section 4): augmentations, losses, schedules, the step."""
