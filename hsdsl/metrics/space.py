"""The hybrid quotient space of a model, in numbers."""
