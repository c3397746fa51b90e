"""Exact answers for tests: closed forms and high-precision numbers that owe nothing to the simulator under test."""
