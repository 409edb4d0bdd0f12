"""What pages and the README tell of each paper, with the numbers that the build has."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from reobserve.replication.golden.files import golden_file, read_metrics, read_numbers
from reobserve.replication.parameters.ledger import Ledger

ROOT = Path(__file__).parents[1]


def golden_metrics(paper: str, figure: str) -> dict[tuple[str, str], float]:
    """The accepted metrics of a figure or the theory, by observer and metric."""
    metrics = read_metrics(ROOT, paper, figure)
    return {(metric.observer, metric.metric): metric.value for metric in metrics}


def percent(number: float, digits: int = 2) -> str:
    return f"{float(f'{100 * number:.{digits}g}'):g} %"


def of_ilo() -> Iterator[str]:
    figures = [golden_metrics("ilo", name) for name in ("fig1", "fig2", "fig3", "fig5")]
    for observer in ("sampled", "continuous", "forgetting"):
        scores = [percent(figure[observer, "relative_rms_error"]) for figure in figures]
        yield f"| `{observer}` | {' | '.join(scores)} |"
    fig4 = golden_metrics("ilo", "fig4")
    worst = percent(fig4["adaptive", "relative_rms_error"], 3)
    yield f"an error of {worst} with the smallest gains"
    matching = golden_metrics("ilo", "fig4_matched")
    law = Ledger.load(ROOT, "ilo").section("observers", "continuous")
    gains = Ledger.load(ROOT, "ilo").section("studies", "matching")["integral_gains"]
    matched, greatest = (
        percent(matching["integral", f"relative_rms_error integral_gain={gain:g}"])
        for gain in (law["K2"] / law["update_interval"], max(gains))
    )
    yield f"{matched} with the integral gain of the learning observer and {greatest} with"
    yield f"which is another law, the error is {percent(fig4['matched', 'relative_rms_error'])}."


def of_lie() -> Iterator[str]:
    fig1 = golden_metrics("lie", "fig1")
    for observer in ("constant", "order4", "injection"):
        names = ("ise", "settling_time", "floquet_exponent")
        numbers = [f"{fig1[observer, name]:.3g}" for name in names]
        yield f"| `{observer}` | {' | '.join(numbers)} |"
    share = golden_metrics("lie", "fig1_ensemble")["series", "share_better order=4"]
    yield f"a smaller integral of the squared error from {percent(share)} of the initial states"
    ensemble = golden_metrics("lie", "fig1_ensemble")
    terms = Ledger.load(ROOT, "lie").section("designs", "cubic")["injection"]
    first, second = (term["coefficient"] for term in terms if term["powers"] == [3])
    yield f"({first:g}, {second:g}) y³, in identity form of order 4, has an integral"
    better = percent(ensemble["cubic4", "share_better order=4"])
    yield f"of {ensemble['cubic4', 'ise']:.3g} s and is better from {better} of the initial states"
    settled, decay = (
        [abs(ensemble[name, metric]) for name in ("cubic4", "constant")]
        for metric in ("settling_time", "decay_rate")
    )
    yield f"after {settled[0]:.3g} s against {settled[1]:.3g} s"
    yield f"at {decay[0]:.3g} against {decay[1]:.3g} 1/s"
    table = read_numbers(golden_file(ROOT, "lie", "table_coefficients"))
    rows = {row for (row, column, _), cell in table.items() if column == "printed" and cell.value}
    agree = [table[row, "agrees", ""].value for row in rows]
    assert agree == ["yes"] * 10
    yield "All ten nonlinear coefficients"


def of_delay() -> Iterator[str]:
    names = ("rms_delay_error", "rms_error_1", "rms_error_2")
    figures = {"1": ("order2", "standard"), "2": ("order2_noise", "standard_noise")}
    for figure, observers in figures.items():
        found = golden_metrics("delay", f"fig{figure}")
        for observer in observers:
            numbers = [
                f" {found[observer, name]:.2g} " if (observer, name) in found else " "
                for name in names
            ]
            yield f"| `{observer}`, Fig. {figure} |{'|'.join(numbers)}|"
    start = Ledger.load(ROOT, "delay").section("metrics")["start"]
    yield f"RMS errors from {start:g} s on:"
    gains = golden_metrics("delay", "fig2_tradeoff")
    second, first = (gains[f"order{m}_noise", "rms_delay_error rho=2.5"] for m in (2, 1))
    yield f"(RMS {second:.3g} against {first:.3g} s without noise)"


_NOISE = 0.1  # of the outputs, for the detectors that are compared


def of_imm() -> Iterator[str]:
    plain = {**golden_metrics("imm", "fig5_plain"), **golden_metrics("imm", "fig7_plain")}
    tuned = {**golden_metrics("imm", "fig5"), **golden_metrics("imm", "fig7")}
    observers = Ledger.load(ROOT, "imm").section("observers")
    for name in ("kalman", "svsf", "svsf_thin"):
        normal, leak = observers[name]["quoted"]
        columns = [f"{100 * normal:g} % / {100 * leak:g} %"]
        for found, observer in ((plain, name), (tuned, f"{name}_tuned")):
            values = [found[observer, f"{mode}_after"] for mode in ("normal", "leakage")]
            columns.append(" / ".join(percent(round(value, 8)) for value in values))
        yield f"| `{name}` | {' | '.join(columns)} |"
    near = golden_metrics("imm", "fig5_neighbourhood")
    yield f"({near['search', 'trials']:g} trials,"
    low, high = (near["leave", f"{end}_factor"] - 1 for end in ("least", "greatest"))
    yield f"by {low * 100:.1g} % and +{high * 100:.2g} %"
    assert tuned["svsf_thin_tuned", "outside_share"] == tuned["svsf_tuned", "outside_share"] == 0
    yield "no innovation leaves the boundary layers"
    yield from _of_layers_that_switch()
    gaps = golden_metrics("imm", "fig8_closeness")
    enough = Ledger.load(ROOT, "imm").section("studies", "closeness")["enough"]
    yield f"With noise of {100 * _NOISE:g} %"
    yield f"suffice for {100 * enough:g} % of the faults"
    detectors = ("cusum", "kalman", "svsf", "glr")
    plants = {
        "exact": "one of the models exactly",
        "driven": "with the process noise that Q states",
    }
    for plant, told in plants.items():
        needed = [
            f"{gaps[name, f'least_gap noise={_NOISE} plant={plant}']:.2g}" for name in detectors
        ]
        yield f"| {told} | {' | '.join(needed)} |"


def _of_layers_that_switch() -> Iterator[str]:
    """The setting in which thin layers are left, and what switching has to do with the lead."""
    found = golden_metrics("imm", "fig5_switching")
    causes = golden_metrics("imm", "fig8_causes_switching")
    search = golden_metrics("imm", "fig5_switching_neighbourhood")
    outside = found["svsf_thin_retuned", "outside_share"]
    assert found["svsf_retuned", "outside_share"] == 0
    yield f"{100 * outside:.2g} % of the innovations lie outside the thin layers and none outside"
    yield f"({search['search', 'trials']:g} trials,"
    leak = {name: causes["svsf_thin_retuned", f"fault_after variant={name}"]
            for name in ("whole", "held")}  # fmt: skip
    kalman = found["kalman_retuned", "leakage_after"]
    switching = (leak["whole"] - leak["held"]) / (leak["whole"] - kalman)
    yield f"{100 * switching:.2g} % of the thin layers' lead over the KF-IMM is due to switching"


def of_eso() -> Iterator[str]:
    actuator, sensor = golden_metrics("eso", "fig2"), golden_metrics("eso", "fig3")
    for name in ("pi", "pd_pi", "least_gamma"):
        numbers = [
            f"{actuator[name, 'actuator_lag']:.2g} s",
            f"{sensor[name, 'sensor_lag']:.2g} s",
            f"{actuator[name, 'rms_actuator_error_varying']:.2g} V",
            f"{sensor[name, 'rms_sensor_error_varying']:.2g} rad/s",
        ]
        yield f"| `{name}` | {' | '.join(numbers)} |"
    designs = Ledger.load(ROOT, "eso").section("designs")
    yield f"With gamma {100 * (designs['pd_pi']['factor'] - 1):g} % above it"
    bound, radius = (designs["least_gamma"][key] for key in ("pole_bound", "radius"))
    yield f"poles within {bound:g}/s and matrices of norm up to {radius:g}"
    fault = golden_metrics("eso", "fig3_designs")
    share = max(
        fault["pi_optimal", f"rms_{one}_difference"] / fault["plant", f"rms_{one}_fault_varying"]
        for one in ("actuator", "sensor")
    )
    yield f"by {100 * share:.1g} % of the fault at most"
    theory = golden_metrics("eso", "theory")
    passes = [
        theory[name, "noise_in_sensor_fault"] / theory["noise", "deviation"]
        for name in ("pd_pi", "least_gamma")
    ]
    yield f"a fraction of {passes[0]:.2g} reaches the estimated sensor fault"
    yield f"all of it ({passes[1]:.3g}), as the paper says"


# Digits that are names: figures, equations, remarks, gains, orders, licences.
NAMES = re.compile(
    r"Figs?\. \d|\(\d+\)|Remark \d\.\d|Theorem \d|\bK[12]\b|\bm = \d|\border \d|BSD 3-Clause"
    r"|\[1/s\]|`[^`]*`|!\[.*?\]\(.*?\)|\]\(tests/reference/.*?\)",
    re.IGNORECASE,
)


def squeezed(text: str) -> str:
    return re.sub(r"\s+", " ", text)


def numbers_left(text: str, told: list[str]) -> list[str]:
    """Digits, with what stands around them, that are no code, no names and not in ``told``."""
    prose = re.sub(r"```.*?```", " ", text, flags=re.DOTALL)
    left = squeezed("\n".join(line for line in prose.splitlines() if not line.startswith("    ")))
    for one in told:
        left = left.replace(one, " ")
    return re.findall(r".{0,30}\d.{0,30}", NAMES.sub(" ", left))
