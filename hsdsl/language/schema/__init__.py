"""The shape of a model file: what may stand where.

`documents` has the keys of each mapping, and reads nodes into them; `fields` has the values that each may hold, and
`jsonschema` is made of both.
"""
