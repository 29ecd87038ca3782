"""From findings to a verdict: decision, document, text, pictures."""
