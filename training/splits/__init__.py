"""Ways to divide a dataset: one file each; the file's name is the split's name."""
