"""Fitting a subject (paper, section 3.3).

``correspondences`` finds targets in the clouds; ``pose`` is algorithm 1, ``shape`` algorithm 2, ``skin``
algorithm 3; ``adapt`` alternates them (algorithm 4); ``start`` finds first poses and a first size, ``examples``
chooses which poses to adapt to.
"""
