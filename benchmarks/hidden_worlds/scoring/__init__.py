"""What was judged beside what is true: the only code that opens both."""
