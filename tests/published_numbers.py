"""The statements with numbers in pages and the README, computed from the golden numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import Any

from docs.generate.evidence import Paper, papers
from reobserve_papers.claims.checks import Reference
from reobserve_papers.golden.number_files import golden_file, read_metrics, read_numbers
from reobserve_papers.metrics.metrics import Numbers, lookup
from reobserve_papers.papers.lie.operations import operations
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator, evaluate
from tests import ROOT
from tests.reobserve.synthesis.normal_form.systems import van_der_pol
from tests.reobserve_papers.papers.lie.test_convergence_of_the_example import measures


def golden_metrics(paper: str, figure: str) -> dict[tuple[str, str], float]:
    """The accepted metrics of a figure or the theory, by observer and metric."""
    metrics = read_metrics(ROOT, paper, figure)
    return {(metric.observer, metric.metric): metric.value for metric in metrics}


@cache
def _paper(name: str) -> Paper:
    return next(paper for paper in papers(ROOT) if paper.name == name)


def _outcomes(paper: str, claim: str) -> list[tuple[tuple[object, ...], str]]:
    """The samples of a claim: what was chosen, and whether the claim holds."""
    decider = _paper(paper).decider
    drawn = decider.samples[claim]
    registered = next(one for one in _paper(paper).registry.claims if one.name == claim)
    found = zip(drawn.trials, drawn.outcomes(registered), strict=True)
    return [(tuple(trial.values), str(outcome)) for trial, outcome in found]


def _held(paper: str, claim: str, word: object = "") -> str:
    """In how many samples a claim holds, of all or of those with a ``word`` among their choices."""
    outcomes = [one for chosen, one in _outcomes(paper, claim) if not word or word in chosen]
    return f"{outcomes.count('holds')} of {len(outcomes) - outcomes.count('no case')}"


def percent(number: float, digits: int = 2) -> str:
    return f"{float(f'{100 * number:.{digits}g}'):g} %"


@cache
def evidence(paper: str) -> Paper:
    """What git holds of a paper."""
    return next(one for one in papers(ROOT) if one.name == paper)


def held(paper: str, claim: str, alternative: str = "") -> str:
    """In how many of its samples a claim holds, as it is or as an alternative has it."""
    decider = evidence(paper).decider
    asked = (
        next(one.claims[claim] for one in decider.alternatives() if one.name == alternative)
        if alternative
        else next(one for one in decider.registry.claims if one.name == claim)
    )
    counted = decider.counted(asked, decider.outcomes(asked))
    return f"{counted.held} of {counted.samples}"


def of_ilo() -> Iterator[str]:
    figures = [golden_metrics("ilo", name) for name in ("fig1", "fig2", "fig3", "fig5")]
    for observer in ("sampled", "continuous", "forgetting"):
        errors = [figure[observer, "relative_rms_error"] for figure in figures]
        # A vanishing error is only integration error.
        scores = [percent(error) if error > 1e-5 else "< 0.001 %" for error in errors]
        yield f"| `{observer}` | {' | '.join(scores)} |"
    fig4 = golden_metrics("ilo", "fig4")
    worst = percent(fig4["adaptive", "relative_rms_error"], 3)
    yield f"an error of {worst} with the smallest gains"
    matching = golden_metrics("ilo", "fig4_matched")
    law = Parameters.load(ROOT, "ilo").section("observers", "continuous")
    gains = Parameters.load(ROOT, "ilo").section("studies", "matching")["integral_gains"]
    matched, greatest = (
        percent(matching["integral", f"relative_rms_error integral_gain={gain:g}"])
        for gain in (law["K2"] / law["update_interval"], max(gains))
    )
    yield f"{matched} with the integral gain K2 / tau of `continuous` and {greatest} with"
    error = percent(fig4["matched", "relative_rms_error"])
    yield f"which is another observer, the error is {error}."
    theory = golden_metrics("ilo", "theory")
    learning, integral = (
        percent(theory[name, "relative_error_under_random_fault"]) for name in ("best", "integral")
    )
    theory_settings = Parameters.load(ROOT, "ilo").section("theory")
    spacing = theory_settings["fault_spacing"]
    yield f"With {spacing:g} s between values the error is {learning} with the learning observer"
    yield f"and {integral} with the integrator"
    without = {"observers": {"sampled": {"K1": 0.0, "K2": 5000.0, "observer_gain": 1.0}}}
    unlearned = [
        percent(
            lookup(evaluate(Parameters.load(ROOT, "ilo", without), figure).numbers)[
                "sampled", "relative_rms_error"
            ]
        )
        for figure in ("fig1", "fig2", "fig3", "fig5")
    ]
    listed = f"{', '.join(unlearned[:3])} and {unlearned[3]}"
    yield f"(K1 = 0, K2 = 5000, Lambda = 1) the errors would be {listed}, so the constant"
    equal = {"theory": {"adaptive_gain": 5 * theory_settings["adaptive_gain"]}}
    error = lookup(Evaluator(Parameters.load(ROOT, "ilo", equal)).theory())[
        "integral", "relative_error_under_random_fault"
    ]
    yield f"with all of it the error is {percent(error)}."
    estimated, samples = _held("ilo", "any_fault").split(" of ")
    yield f"of {samples} samples it estimates {estimated} and misses the fastest"
    accurate = [f"{kind}_accurate" for kind in ("stuck", "periodic", "aperiodic", "combined")]
    rival = "learning_estimates_time_varying"
    for variant in ("sampled", "continuous", "forgetting"):
        cells = [_held("ilo", claim, variant) for claim in (*accurate, rival)]
        yield f"| `{variant}` | {' | '.join(cells)} |"


def of_lie() -> Iterator[str]:
    fig1 = golden_metrics("lie", "fig1")
    for observer in ("constant", "order4", "injection"):
        names = ("ise", "settling_time", "floquet_exponent")
        numbers = [f"{fig1[observer, name]:.3g}" for name in names]
        yield f"| `{observer}` | {' | '.join(numbers)} |"
    ensemble = golden_metrics("lie", "fig1_ensemble")
    cubic = [ensemble["cubic4", name] for name in ("ise", "settling_time")]
    yield f"| `cubic4` | {cubic[0]:.3g} | {cubic[1]:.3g} | – |"
    share = percent(ensemble["series", "share_better order=4"])
    best = percent(1 - ensemble["series", "minimum_ise_ratio order=4"])
    yield f"error from {share} of the initial states, at best by {best}"
    terms = Parameters.load(ROOT, "lie").section("designs", "cubic")["injection"]
    first, second = (term["coefficient"] for term in terms if term["powers"] == [3])
    yield f"({first:g}, {second:g}) y³ has an integral"
    better = percent(ensemble["cubic4", "share_better order=4"])
    yield f"of {ensemble['cubic4', 'ise']:.3g} s and is better from {better} of the initial states"
    settled, decay = (
        [abs(ensemble[name, metric]) for name in ("cubic4", "constant")]
        for metric in ("settling_time", "decay_rate")
    )
    yield f"after {settled[0]:.3g} s against {settled[1]:.3g} s"
    yield f"at {decay[0]:.3g} against {decay[1]:.3g} 1/s"
    square, _, early = measures((2.0, 0.5), -0.5)
    yield f"(-0.5, -0.5) y³ has an integral of {square:.3g} s and settles after {early:.3g} s"
    yield f"as the degree to the power {-(1 + 0.5 / 1.0594):.3g} there (80 digits, to degree 121)"
    degree = Parameters.load(ROOT, "lie").section("studies", "domain")["degree"]
    yield f"the boundary drawn outside is an estimate at degree {degree}"
    yield "What Remarks 3.7 and 4.19 require"
    table = read_numbers(golden_file(ROOT, "lie", "table_coefficients"))
    rows = {row for (row, column, _), cell in table.items() if column == "printed" and cell.value}
    agree = [table[row, "agrees", ""].value for row in rows]
    assert agree == ["yes"] * 10
    yield "All ten nonlinear coefficients"
    drawn = _paper("lie").decider.samples["injection_improves_the_error"].trials
    order = Reference("theory", "nonlinear", "share_better_at_order_0 measure=square")
    better = sum(bool(trial.numbers) and trial.numbers[order] > 0.5 for trial in drawn)
    yield f"{better} of {len(drawn)} random injections are better"
    name = "injection_improves_the_error"
    yield f"in {held('lie', name, 'lie_injections_at_random')} random"
    counts = operations(van_der_pol().problem(5))
    plain, divided, four = (
        counts.lie("eliminated", how) for how in ("elimination", "division", "real_division")
    )
    methods = f"{plain} operations with elimination and {divided} in eigenvectors of F and A"
    yield f"For T to degree 5 it takes {methods} (Remark 4.18)"
    yield f"or {four} if each"
    by_degree = [counts.brute_force("by_degree", how) for how in ("elimination", "division")]
    yield f"Brute force takes {by_degree[0]} degree by degree, {by_degree[1]} in eigenvectors"
    yield f"and {counts.brute_force('all_at_once', 'elimination')} all at once"
    yield f"takes {counts.lie('open', 'division')} or more"


def of_delay() -> Iterator[str]:
    names = ("rms_delay_error", "rms_error_1", "rms_error_2")
    first, gains = golden_metrics("delay", "fig1"), golden_metrics("delay", "fig2_tradeoff")
    rows = {
        **{(name, "Fig. 1"): (first, "") for name in ("order2", "standard")},
        **{
            (f"{name}_noise", "Fig. 2"): (gains, " noise_rho=2.5")
            for name in ("order2", "order1", "standard")
        },
    }
    for (observer, figure), (found, level) in rows.items():
        numbers = [
            f" {found[observer, name + level]:.2g} " if (observer, name + level) in found else " "
            for name in names
        ]
        yield f"| `{observer}`, {figure} |{'|'.join(numbers)}|"
    parameters = Parameters.load(ROOT, "delay")
    runs = parameters.section("studies", "tradeoff")["runs"]
    metrics = parameters.section("metrics")
    yield f"RMS errors from {metrics['start']:g} s on"
    yield f"from {metrics['varying_from']:g} to {metrics['varying_until']:g} s, where the delay"
    standard, ours = (first[name, "rms_error_2_from_start"] for name in ("standard", "order2"))
    if standard < ours:
        yield "not from t = 0 on"
    yield f"but from {metrics['start']:g} s on"
    yield f"means over {runs} runs with other noise:"
    noisy = [gains[f"order{m}_noise", "varying_rms_delay_error noise_rho=2.5"] for m in (2, 1)]
    yield "an RMS error of {:.2g} against {:.2g} s".format(*noisy)
    yield "below 5 % of the average delay"
    higher = [
        held("delay", "higher_order_more_accurate", one) for one in ("", "less: any_difference")
    ]
    yield "it is by 5 % in {} samples, by any difference in {},".format(*higher)
    yield f"it is in {held('delay', 'fig1_states_better')} samples"
    yield from _of_delay_readings(parameters)
    accurate = held("delay", "fig3_relay_more_accurate")
    yield f"than the extended observer in {accurate} samples"
    quiet = "order2_noise", "varying_rms_delay_error rho=10"
    yield f"a gain of 10 without noise, {gains[quiet]:.2g} s"
    rhos = parameters.section("studies", "tradeoff")["rhos"]
    best = min(rhos, key=lambda rho: gains[_with_noise(rho)])
    yield f"the best gain of those tried is {best:g}"


def _of_delay_readings(parameters: Parameters) -> Iterator[str]:
    """In how many samples claims hold with either gain of Fig. 2, and with other readings."""
    caption, text = (parameters.section("observers", f"order2{of}")["rho"] for of in ("_noise", ""))
    yield f"Its caption has the gain {caption:g}, the text and Table I have {text:g}."
    yield f"The figure is drawn with {caption:g};"
    yield f"| claim | samples with {caption:g} | with {text:g} |"
    for claim in ("singular_peaks", "noise_estimates", "switching_off_helps"):
        cells = [_held("delay", claim, rho) for rho in (caption, text)]
        yield f"(#claim-{claim}) | {' | '.join(cells)} |"
    yield f"With {caption:g}, m = 2 is hardly more accurate than m = 1"
    less = evidence("delay").registry.conventions.values["less"]
    yield f"less, by {percent(1 - less)}, than the error of its average"
    whole, half = (
        held("delay", "works_for_varying_delays", one) for one in ("", "delay_half_of_the_average")
    )
    yield f"It holds in {whole} samples, with half of that error as the bound in {half}."
    theory = golden_metrics("delay", "theory")
    yield f"up to {theory['projection', 'lyapunov_rate']:.2g} times rho"
    first = golden_metrics("delay", "fig1")
    ball = [first["order2", name] for name in ("varying_largest_delay_error", "delay_radius")]
    yield f"{ball[0] / ball[1]:.2g} times as large"
    rates = [theory["order_2", f"rate_of_xi rho={rho}"] for rho in ("2.5", "40")]
    yield "{:.2g} at 2.5 to {:.2g} at 40".format(*rates)


def _with_noise(rho: float) -> tuple[str, str]:
    return "order2_noise", f"varying_rms_delay_error noise_rho={rho:g}"


def of_imm() -> Iterator[str]:
    plain = {**golden_metrics("imm", "fig5_plain"), **golden_metrics("imm", "fig7_plain")}
    tuned = {**golden_metrics("imm", "fig5"), **golden_metrics("imm", "fig7")}
    observers = Parameters.load(ROOT, "imm").section("observers")
    for name in ("kalman", "svsf", "svsf_thin"):
        normal, leak = observers[name]["quoted"]
        columns = [f"{100 * normal:g} % / {100 * leak:g} %"]
        for found, observer in ((plain, name), (tuned, f"{name}_tuned")):
            values = [found[observer, f"{mode}_after"] for mode in ("normal", "leakage")]
            columns.append(" / ".join(percent(round(value, 8)) for value in values))
        yield f"| `{name}` | {' | '.join(columns)} |"
    yield f"from {_after()}, after a leak at {_parameters('scenarios', 'plain')['onset']:g} s"
    near = golden_metrics("imm", "fig5_neighbourhood")
    yield f"({near['search', 'trials']:g} trials,"
    noise = observers["kalman_tuned"]["measurement_noise"][1]
    size = _parameters("scenarios", "step")["input"][0]["size"]
    plant = Parameters.load(ROOT, "imm").section("plant")
    before, after = (
        size * plant[f"{mode}_numerator"][-1] / plant[f"{mode}_denominator"][-1]
        for mode in ("normal", "leakage")
    )
    yield f"of {noise**0.5:.2g} y, where"
    yield f"is {before:.2g} y before the leak and {after:.1g} y after it"
    stated = observers["kalman"]["process_noise"]
    less = {"observers": {"kalman": {"process_noise": [3e-8] * len(stated)}}}
    flips = [
        lookup(evaluate(Parameters.load(ROOT, "imm", less, seed), "fig5_plain").numbers)
        for seed in range(8)
    ]
    assert all(numbers["svsf", "normal_spread"] > 0.4 for numbers in flips)
    yield "a mean of jumps between 0 and 1"
    low, *_, high = sorted(numbers["svsf", "normal_after"] for numbers in flips)
    yield f"noise of 3e-8 instead of {stated[0]:g}"
    yield f"mode is then {100 * low:.2g} to {percent(high)} with eight seeds"
    normal = max(numbers["kalman", "normal_after"] for numbers in flips)
    yield f"KF-IMM still gives {100 * normal:.0f} % in place of 85 %"
    yield f", {held('imm', 'svsf_bounded')}) is no merit of its gain alone"
    low, high = (near["leave", f"{end}_factor"] - 1 for end in ("minimum", "maximum"))
    yield f"by {low * 100:.2g} % and +{high * 100:.2g} %"
    saturated = [tuned[f"{name}_tuned", "saturation_fraction"] for name in ("svsf", "svsf_thin")]
    assert saturated == [0, 0]
    yield "No innovation leaves the boundary layers"
    yield from _of_layers_that_switch()
    yield from _of_samples()


def _of_samples() -> Iterator[str]:
    """How often a main claim holds, also of filters with random gains."""
    decider = _paper("imm").decider
    null = next(one for one in decider.registry.claims if one.name == "svsf_robust").with_null
    random = decider.counted(null, decider.outcomes(null))
    yield f"in {random.held} of {random.samples} samples, the SVSF in {_held('imm', 'svsf_robust')}"
    sides: dict[bool, list[str]] = {True: [], False: []}
    for chosen, word in _outcomes("imm", "svsf_robust"):
        exciting = any(isinstance(one, list) and one[0]["kind"] == "prbs" for one in chosen)
        if word != "no case":
            sides[exciting and bool({"motion", "derivatives"} & set(map(str, chosen)))].append(word)
    inside, others = (f"{words.count('holds')} of {len(words)}" for words in sides.values())
    yield f"in {inside} samples with three outputs"
    yield f"in {others} others"


def _parameters(section: str, name: str) -> dict[str, Any]:
    return Parameters.load(ROOT, "imm").section(section, name)


def _after() -> str:
    """The time over which probabilities are compared."""
    start, end = Parameters.load(ROOT, "imm").section("metrics")["after"]
    return f"{start:g} to {end:g} s"


def _of_layers_that_switch() -> Iterator[str]:
    """The setting with thin layers only, and how switching relates to the lead."""
    found = golden_metrics("imm", "fig5_switching")
    causes = golden_metrics("imm", "fig8_causes")
    near = golden_metrics("imm", "fig5_switching_neighbourhood")
    outside = found["svsf_thin_retuned", "saturation_fraction"]
    assert found["svsf_retuned", "saturation_fraction"] == 0
    assert found["svsf_thin_retuned", "chattering_fraction"] == 0
    assert found["svsf_retuned", "overshoot"] > 0.05 > found["svsf_thin_retuned", "overshoot"]
    yield f"{100 * outside:.2g} % of the innovations lie outside the thin layers and none outside"
    trials, earlier = (near["search", name] for name in ("trials", "earlier_trials"))
    yield f"({trials:g} trials after {earlier:g} by other rules"
    band = _parameters("studies", "switching_neighbourhood")["band"]
    yield f"before one value is more than {band:g} off"
    fall = percent(1 - near["leave", "minimum_factor"])
    yield f"the probability of leaving a mode may fall by {fall}"
    leak = [
        causes["svsf_thin_retuned", f"fault_after variant={name}"] for name in ("whole", "frozen")
    ]
    assert abs(leak[0] - leak[1]) < 1e-6
    yield f"from {_after()} the leak has {percent(leak[1], 3)}, as it has"


def of_eso() -> Iterator[str]:
    study = Numbers(golden_metrics("eso", "fig3_designs"))
    for name, kind, at in (
        ("pi", "pi_feasible", {"decay": 1}),
        ("pd_pi", "pd_pi_minimum_norm", {"factor": 1.05}),
        ("minimum_gamma", "pd_pi_minimum_gamma", {"bound": 50}),
    ):
        found = {f: study.at(kind, f, rate=1, **at) for f in (
            "actuator_lag", "sensor_lag", "rms_actuator_error_varying", "rms_sensor_error_varying"
        )}  # fmt: skip
        units = ("s", "s", "V", "rad/s")
        cells = [f"{v:.2g} {u}" for v, u in zip(found.values(), units, strict=True)]
        yield f"| `{name}` | {' | '.join(cells)} |"
    designs = Parameters.load(ROOT, "eso").section("designs")
    yield f"With gamma {100 * (designs['pd_pi']['factor'] - 1):g} % above it"
    bound, radius = (designs["minimum_gamma"][key] for key in ("pole_bound", "radius"))
    yield f"poles within {bound:g}/s and matrices of norm up to {radius:g}"
    later = {}
    lags = {f: study.at("pd_pi_minimum_norm", f"{f}_lag", rate=1, factor=1.05) for f in _ESO_FAULTS}
    for kind in ("pi_feasible", "pi_positive", "pi_largest_margin"):
        pairs = [metric.split(" ", 1)[1] for name, metric in study
                 if name == kind and metric.startswith("sensor_lag ")]  # fmt: skip
        later[kind] = sum(
            all(study[kind, f"{f}_lag {pair}"] > lags[f] for f in _ESO_FAULTS) for pair in pairs
        )
    first, centres, margins = later.values()
    yield f"Among {len(pairs)} pairs of decay and filter rate"
    yield f"with {first} observers of minimum norm"
    yield f"but with {centres} of the analytic centres and {margins} of the largest margins"
    share = max(
        study["pi_optimal", f"rms_{one}_difference"] / study["plant", f"rms_{one}_fault_varying"]
        for one in _ESO_FAULTS
    )
    yield f"by {100 * share:.1g} % of the fault at most"
    levels = Parameters.load(ROOT, "eso").section("studies", "designs")
    bound, radius = levels["pole_bounds"][0], levels["radii"][-1]
    with_derivative, without = (
        [study.at(kind, f"{f}_lag", rate=1, radius=radius) for f in _ESO_FAULTS]
        for kind in ("pd_pi_minimum_gamma", "pi_minimum_gamma")
    )
    shares = [one / other for one, other in zip(with_derivative, without, strict=True)]
    yield (
        f"poles within {bound:g}/s and matrices of norm up to {radius:g}, the lags of the PD/PI "
        f"observer are {shares[0]:.2g} and {shares[1]:.2g} of the PI observer's, "
        f"{without[0]:.2g} and {without[1]:.2g} s"
    )
    theory = golden_metrics("eso", "theory")
    norms = [theory[name, "norm"] for name in ("pd_pi", "minimum_gamma", "pi")]
    yield (
        "The norms are {:.3g} for `pd_pi`, {:.3g} for `minimum_gamma`, "
        "and {:.3g} for the PI observer"
    ).format(*norms)
    yield f"at least {theory['pd_pi', 'gamma'] / designs['pd_pi']['factor']:.6g}, the gain"
    channel = "norm from=disturbances to=errors"
    yield f"is {theory['pd_pi', channel]:.8g} for `pd_pi`"
    yield f"and {theory['pi', channel]:.2g} for `pi`"
    passes = [
        theory[name, "noise_in_sensor_fault at=ends"] / theory["noise", "deviation"]
        for name in ("pd_pi", "minimum_gamma")
    ]
    yield f"a fraction of {passes[0]:.2g} reaches the estimated sensor fault with `pd_pi`"
    yield f"and {passes[1]:.3g} with `minimum_gamma`"
    yield from _of_eso_shares()


def _of_eso_shares() -> Iterator[str]:
    """In how many samples claims hold, and with which alternatives."""
    yield f"it does in {held('eso', 'faster')} samples"
    yield f"as in the paper's table, it is in {_held('eso', 'disturbances_attenuated', 'A')}."
    words = [word for _, word in _outcomes("eso", "disturbances_attenuated")]
    yield f"in {words.count('tie')} others the two differ by less than 5 %"
    in_time = held("eso", "any_form", "lag: removed")
    yield f"Without counting the lag it holds in {in_time} samples"
    yield f"faults are reconstructed in {held('eso', 'reconstruction')}"
    yield f"it does in {held('eso', 'derivative_is_fast')} samples"
    amperes, milliamperes = (_held("eso", "pi_cannot_follow", unit) for unit in ("A", "mA"))
    yield f"It holds in {held('eso', 'pi_cannot_follow')} samples, in {amperes} with currents in A"
    yield f"and in {milliamperes} in mA"
    yield f"it is in {held('eso', 'disturbances_attenuated')} samples"


_ESO_FAULTS = ("actuator", "sensor")


# Digits that are part of names: figures, equations, remarks, gains, orders, licences.
NAMES = re.compile(
    r"Figs?\. \d|\(\d+\)|Remark \d(?:\.\d)?|Theorem \d|\bK[12]\b|\bm = \d|\border \d|BSD 3-Clause"
    r"|\[1/s\]|`[^`]*`|!\[.*?\]\(.*?\)|\]\((?:tests/reference/|#claim-).*?\)",
    re.IGNORECASE,
)


def squeezed(text: str) -> str:
    return re.sub(r"\s+", " ", text)


def numbers_left(text: str, reported: list[str]) -> list[str]:
    """Digits, with what stands around them, that are no code, no names and not in ``reported``."""
    prose = re.sub(r"```.*?```|<img[^>]*>", " ", text, flags=re.DOTALL)
    left = squeezed("\n".join(line for line in prose.splitlines() if not line.startswith("    ")))
    for one in reported:
        left = left.replace(one, " ")
    return re.findall(r".{0,30}\d.{0,30}", NAMES.sub(" ", left))
