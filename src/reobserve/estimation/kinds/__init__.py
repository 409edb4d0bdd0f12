"""The observers that a specification can name: what each is told, and how it is made ready."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from reobserve.estimation.kinds.design_file import DesignFile
from reobserve.estimation.kinds.extended_state import Eso
from reobserve.estimation.kinds.linear import (
    AugmentedKalman,
    FixedGain,
    Imm,
    Kalman,
    Luenberger,
    SteadyKalman,
    Svsf,
)
from reobserve.estimation.kinds.nonlinear import (
    ExtendedHighGain,
    HighGain,
    Levant,
    NormalForm,
)
from reobserve.estimation.kinds.rigid_body import Adaptive, Ilo

Observer = Annotated[
    Ilo
    | Adaptive
    | NormalForm
    | HighGain
    | ExtendedHighGain
    | Levant
    | Kalman
    | AugmentedKalman
    | Svsf
    | Imm
    | Eso
    | FixedGain
    | Luenberger
    | SteadyKalman
    | DesignFile,
    Field(discriminator="kind"),
]

__all__ = ["Observer"]
