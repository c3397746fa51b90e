"""engine/preparation."""
