"""Settings stated in captions agree with those of the runs."""

from __future__ import annotations

from reobserve_papers.papers.imm import keys, notes
from reobserve_papers.parameters.job import read_job
from tests.reobserve_papers.papers.imm.test_paper import parameters


def test_boundary_layers_are_stated_in_output_units() -> None:
    changes = {"observers": {"svsf": {"layer_scale": 1e-3}}}
    job = read_job(keys.Parameters, parameters(changes).settings("plot", "fig5_plain"))
    assert notes.layers(job) == "Boundary layers of [0.1, 1, 10] y s, y and y/s."


def test_thinner_layer_is_stated_as_a_factor() -> None:
    changes = {"observers": {"svsf": {"layer_factor": 0.25}}}
    job = read_job(keys.Parameters, parameters(changes).settings("plot", "fig5_plain"))
    assert notes.layers(job).endswith("] × 0.25 y s, y and y/s.")


def test_figures_of_searched_banks_say_so_first_and_name_the_plain_figure() -> None:
    """Where banks were tuned to the quoted values, and only there."""
    file = parameters({})
    tuned = {name for body in file.tree["searches"].values() for name in body["observers"]}
    for name, figure in file.tree["figures"].items():
        if figure["layout"] not in ("normal", "leakage", "switching"):
            continue
        first = notes.note(read_job(keys.Parameters, file.settings("plot", name))).split("\n")[0]
        searched = set(figure["observers"]) <= tuned
        assert first.startswith("Setting searched for") == searched, name
        if searched:
            plain = first.rpartition(" ")[2].rstrip(".")
            assert not set(file.tree["figures"][plain]["observers"]) & tuned
