"""The courses of the models that ship: another seed, other pictures, another way of seeing for the judge."""

from __future__ import annotations

from dreamfields_core.teaching.lessons import Course

COURSES: dict[str, Course] = {
    "guide": Course(
        seed=1,
        sizes={"seeing": "convolution", "fine": 48, "coarse": 128, "fine_blocks": 2, "coarse_blocks": 3},
        plain_steps=2250,
        robust_terms=((1950, 1.2e-3), (1800, 1e-3)),
        radius=1.0,
        learning_rate=2e-3,
        horizon=6000,
    ),
    "judge": Course(
        seed=2,
        sizes={"seeing": "attention", "fine": 48, "coarse": 128, "fine_blocks": 2, "coarse_blocks": 4},
        plain_steps=2700,
        robust_terms=((900, 5e-4), (1500, 6e-4)),
        radius=0.5,
        learning_rate=1.2e-3,
        horizon=5100,
    ),
}
