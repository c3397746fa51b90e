"""Inputs that mean harm: generators, mutations, and what must hold for each of them."""
