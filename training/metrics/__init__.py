"""Agreement of predicted and labelled depth maps."""
