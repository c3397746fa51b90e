"""What every storey may use; nothing here knows what a model is.

`errors` are diagnostics with a place. `names` and `parts` say how things are called; `limits` what a model
may ask for; `defaults` what an experiment is unless it says otherwise. `functions` are those of the language, `graphs`
structures and patterns, `samples` inputs by rows. `numbers` is arithmetic with and without errors.

Around them: `cache` and `atomic` for files that are made; `interrupts`, `processes` and `progress` for long work.
"""
