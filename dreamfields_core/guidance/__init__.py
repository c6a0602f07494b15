"""Image-text models: what a picture must agree with (paper section 3.2)."""
