"""The shape of a model file: what may stand where.

`documents` has the keys of each mapping, `fields` the values that each may hold, and `jsonschema` is made of both.
`read` makes documents of nodes.
"""
