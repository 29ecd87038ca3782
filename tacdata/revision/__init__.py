"""What follows a verdict: the effect is added, labels are made again, the gap is shown, the next presses are named."""
