"""The paper, reproduced: every figure and table of Section V, computed and drawn anew.

``python examples/paper`` writes pictures (PNG, SVG) and the numbers in them (CSV), and prints what was found beside
what is known. What each part computes stands in one module, what it looks like in `paper.drawing`.

==================  ===========================================================================================
`parts`             the table of parts, what ``--only`` names
`quadrants`         Fig. 1 and Sec. V-A: the digital control system, our metric and its rivals
`oscillators`       Table I, Fig. 14a to 14c: the two oscillators and their exact trajectories
`accuracy`          Fig. 14d and 14e: errors of the relaxed scheme, and of Paoli and Schatzman's
`times`             Fig. 14f: computation times
`runner`            Fig. 15 to 17: the runner, its guards, its strides
`results`           what a part finds, and where it puts it
==================  ===========================================================================================
"""
