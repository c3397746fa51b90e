"""Units of expressions: what names are measured in (`unit`), and what follows for expressions (`walk`, `model`).

Units are checked and never converted: metres and millimetres are two units, and their sum is a finding. The unit of
`t` is given like any other. By default it is the second where some unit of the model has time in it, and unknown
elsewhere.
"""
