"""The label farm: solves the presses of recorded sessions once each and writes their labels."""
