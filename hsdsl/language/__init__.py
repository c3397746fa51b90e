"""Text to mathematics, with every error found.

In: the bytes of a model file and of its data (`files`). Out: a `system.HybridSystem`, the paper's Definition 7 as SymPy
expressions over the file's own names, or a `ModelError` with all diagnostics.

`elaborate.elaborate_files` is the whole way. Read in this order: `source` (YAML to nodes with places), `schema` (what
may stand where), `expression` (text to SymPy by whitelist), `elaborate` (names resolved, everything substituted),
`system`. `diagnosis` is imported where one of these has failed: it says what was meant, and reads on. `diagnose` prints
errors.
"""
