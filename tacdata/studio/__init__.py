"""The contents of a lab's folder on one page of this computer; it only reads."""
