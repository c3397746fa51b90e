"""Functional mock-up units, for both versions of FMI: `variables`, their C, their description, and the archive."""
