"""The gallery of hard scenes: ``python examples/gallery`` runs all of them with every tool.

===========  =================================================================================
`scenes`     the scenes: models, words about them, exact executions
`settings`   the runs of our schemes, methods and engines, and of peers
`outcomes`   a run in a process of its own, and its outcome
`records`    outcomes and versions as JSON
`page`       the page, from the records and the models
`pictures`   a picture of each scene
===========  =================================================================================
"""
