"""What people touch.

`model` is `hsdsl.Model`: everything that can be done with a model, each verb in a module of its own. `cli` is the
command line, one short function a verb, no numerics. `chart` compares methods and tools. `imports` reads the models of
other tools.
"""
