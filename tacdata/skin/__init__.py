"""The skin model: a finite-element model of the tactile skin in NVIDIA Warp."""
