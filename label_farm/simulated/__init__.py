"""Simulated datasets: presses that a plan draws, solved by the skin model, read by the sensor file's transduction."""
