"""The steps of the pipeline as functions: `tacdata` offers them in Python, the verbs on the command line."""
