"""The queue of jobs: who works on which, and until when."""
