"""base/numbers."""
