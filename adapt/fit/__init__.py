"""Fitting a subject (paper, section 3.3).

``pose`` is algorithm 1, ``shape`` algorithm 2, ``skin`` algorithm 3; ``alternate`` alternates them (algorithm 4),
``examples`` chooses which poses to adapt to, ``recording`` does all of it for a recording. ``problem`` puts together
the sums of squares that all of them minimise, ``least_squares`` makes them small. ``judge`` decides whether a fit is
believed, ``posterior`` how sure it is. Targets in the clouds come from ``adapt.match``, first poses from
``adapt.search``.
"""
