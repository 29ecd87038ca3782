"""Two fingertips that find out where an object lies between them, and move until it lies well."""
