"""The courses of the models that ship: another seed, other pictures, another way of seeing for the judge.

The first terms show pictures at random, where colour alone tells most captions apart; the later ones show groups that
share their colours, so that the kind has to be learned.
"""

from __future__ import annotations

from dreamfields_core.teaching.terms import Course, Term

COURSES: dict[str, Course] = {
    "guide": Course(
        seed=1,
        sizes={"seeing": "convolution", "fine": 48, "coarse": 128, "fine_blocks": 2, "coarse_blocks": 3},
        terms=(
            Term(2250, 2e-3, last=0.69, warm=150),
            Term(1950, 1.2e-3, radius=1.0, ramp=651),
            Term(1800, 1e-3, radius=1.0),
            Term(7500, 1.2e-3, radius=1.0, alike=8),
            Term(6600, 1.2e-3, alike=8, pairs=0.4),
            Term(6000, 1e-3, radius=1.0, ramp=600, alike=8, pairs=0.4),
            Term(4800, 1e-3, alike=8, pairs=0.4),
            Term(3000, 8e-4, radius=1.0, ramp=300, clean=0.5, alike=8, pairs=0.4),
            Term(2700, 8e-4, alike=8, pairs=0.4),
            Term(1800, 6e-4, radius=1.0, ramp=300, clean=0.67, alike=8, pairs=0.4),
        ),
        pages=100,
    ),
    "judge": Course(
        seed=2,
        sizes={"seeing": "attention", "fine": 48, "coarse": 128, "fine_blocks": 2, "coarse_blocks": 4},
        terms=(
            Term(2700, 1.2e-3, last=0.46, warm=150),
            Term(900, 5e-4, radius=0.5, ramp=301),
            Term(1500, 6e-4, radius=0.5),
            Term(4200, 1e-3, alike=8),
            Term(1500, 6e-4, radius=0.5, ramp=300, alike=8),
            Term(7500, 1e-3, alike=8, pairs=0.4),
            Term(2100, 6e-4, radius=0.5, ramp=300, alike=8, pairs=0.4),
            Term(4800, 1e-3, alike=8, pairs=0.4),
            Term(1200, 5e-4, radius=0.5, ramp=200, clean=0.5, alike=8, pairs=0.4),
        ),
        pages=100,
    ),
}
