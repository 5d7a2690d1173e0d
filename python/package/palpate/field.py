"""The magnetic field of the actuated layer: axisymmetric designs, by finite elements."""

from __future__ import annotations

import os
from collections.abc import Mapping

from ._palpate import Field, designs

__all__ = ["Field", "designs", "solve"]


def solve(
    design: str | os.PathLike[str],
    *,
    current_a: float | None = None,
    changes: Mapping[str, float] | None = None,
    accuracy: float | None = None,
    order: int | None = None,
) -> Field:
    """Solves a design: a file, or the name of a built-in one (`designs()`).

    Without `current_a` the field is that of one ampere, far below saturation. `changes` are numbers of the
    design, as `{"parameters.gap": 4}`. `accuracy` is the relative error to reach, `order` that of the elements.
    """
    options = {"current": current_a, "accuracy": accuracy, "order": order}
    arguments = [f"--{name}={value}" for name, value in options.items() if value is not None]
    arguments += [f"--set={path}={value}" for path, value in (changes or {}).items()]
    return Field([*arguments, "--", os.fspath(design)])
