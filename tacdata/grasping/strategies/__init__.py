"""What a hand goes by when it decides where an object lies between its fingertips: one file each."""
