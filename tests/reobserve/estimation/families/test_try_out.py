"""What an observer refuses to start from is no design, and is refused by its key."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from reobserve.core.errors import InputError
from reobserve.estimation.design_command import run as design
from reobserve.estimation.families.examples import model_text
from reobserve.estimation.families.file import load_design


def designed(kind: str, folder: Path, *changes: str) -> Path:
    model, out = folder / f"{kind}.yaml", folder / "design.json"
    model.write_text(model_text(kind))
    design(kind, model, out, None, changes)
    return out


@pytest.mark.parametrize(
    ("kind", "change", "said"),
    [
        ("kalman", "initial_covariance=[-1,-1]", "initial_covariance: must be positive semidef"),
        ("kalman", "initial_covariance=[[1,2],[3,4]]", "initial_covariance: .* must be symmetric"),
        ("kalman", "initial_covariance=[]", "initial_covariance: has shape"),
        ("imm", "initial_probabilities=[-1,-1]", "initial_probabilities: .* sum to 1, not -2"),
        ("svsf", "initial_covariance=[1,-1]", "initial_covariance: must be positive semidefinite"),
        ("levant", "sampling_period=1e300", "certificate.scale_0: is beyond floating-point"),
        ("luenberger", "sampling_period=1e300", "sampling_period: 1e.300 s takes the states"),
    ],
)
def test_what_cannot_start_is_no_design(kind: str, change: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=rf"{kind}.yaml: {said}"):
        designed(kind, tmp_path, change)
    assert not (tmp_path / "design.json").exists()


@pytest.mark.parametrize("kind", ["levant", "luenberger", "svsf"])
def test_design_without_its_gains_is_refused(kind: str, tmp_path: Path) -> None:
    path = designed(kind, tmp_path)
    tree = json.loads(path.read_text())
    del tree["gains"]
    path.write_text(json.dumps(tree))
    with pytest.raises(InputError, match=rf"gains: are missing; a design of {kind} needs them"):
        load_design(path)


def test_gain_that_is_not_kalmans_is_not_certified(tmp_path: Path) -> None:
    path = designed("kalman", tmp_path, "gain=steady")
    tree = json.loads(path.read_text())
    tree["gains"]["gain"][1][0] *= 1.0 + 1e-5
    path.write_text(json.dumps(tree))
    with pytest.raises(InputError, match=r"gains.gain\[1\]\[0\]: is .* the Riccati equation gives"):
        load_design(path)
