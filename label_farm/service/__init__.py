"""The farm as a service: submissions that outlive it, an HTTP interface, a page."""
