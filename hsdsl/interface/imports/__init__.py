"""Models of other tools as model files of ours: `sbml`, `spaceex`."""
