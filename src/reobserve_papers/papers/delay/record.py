"""Channels and units of the plant's record and of estimates."""

from __future__ import annotations

from reobserve_papers.parameters.job import Job
from reobserve_papers.signals.series import ChannelShape

EVENTS = ("jumps",)

# The units of state, output, input and its first two derivatives, by model.
UNITS = {
    "pendulum": ("rad, rad/s", "rad", "N m", "N m/s, N m/s^2"),
    "lag": ("1", "1", "1", "1/s, 1/s^2"),
}


def plant(job: Job) -> dict[str, ChannelShape]:
    """The channels of the plant's record, of which the measured ones are optional, for noise."""
    states, output, torque, rates = UNITS[job.scenario.model]
    size, inputs = states.count(",") + 1, rates.count(",") + 1
    noisy = {
        "measured": ChannelShape(output, optional=True),
        "measured_input": ChannelShape(torque, None, True),
    }
    return {
        "state": ChannelShape(states, size),
        **dict.fromkeys(("delay", "delay_before"), ChannelShape("s")),
        **dict.fromkeys(("delayed_input", "input", "past_input"), ChannelShape(torque)),
        **dict.fromkeys(("input_derivatives", "past_derivatives"), ChannelShape(rates, inputs)),
        **noisy,
        **{f"{name}_before": shape for name, shape in noisy.items()},
        "read_input": noisy["measured_input"],
    }


def estimates(job: Job) -> dict[str, ChannelShape]:
    """The channels of an observer's estimates: of the state, the delay, or both."""
    observer = job.observer
    found = {"delay": ChannelShape("s", optional=True), "off": ChannelShape("1", optional=True)}
    if hasattr(observer, "model"):
        states = UNITS[observer.model][0]
        found["state"] = ChannelShape(states, states.count(",") + 1, optional=True)
    return found
