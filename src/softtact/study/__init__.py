"""A study: its configuration, checked, and what the configuration names."""
