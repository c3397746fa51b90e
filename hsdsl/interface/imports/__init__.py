"""interface/imports."""
