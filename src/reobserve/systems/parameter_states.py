"""Parameters of a nonlinear model as states of another one, which filters then estimate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, nearest, shown
from reobserve.core.matrices import as_scalar

if TYPE_CHECKING:
    from reobserve.systems.nonlinear import NonlinearModel

Array = NDArray[np.float64]


def with_parameter_states(
    model: NonlinearModel, random_walk: Mapping[str, float]
) -> NonlinearModel:
    """`NonlinearModel.with_parameter_states`."""
    from numba import njit
    from numba.extending import is_jitted

    from reobserve.systems.nonlinear import NonlinearModel

    if not isinstance(random_walk, Mapping) or not random_walk:
        raise InputError("random_walk", f"{shown(random_walk)} must be variances by name")
    known = dict(model.parameters or {})
    walks = {}
    for name, value in random_walk.items():
        place = f"random_walk.{name}"
        if name not in known:
            raise InputError(place, f"is no parameter of the model{nearest(str(name), known)}")
        walks[name] = as_scalar(place, value)
        if walks[name] < 0:
            raise InputError(place, f"{walks[name]:g} must be 0 or more")
    n, q, texts = model.states, len(walks), isinstance(model.f, tuple)
    if isinstance(model.h, tuple) is not texts:
        raise InputError(
            "model", "has one of f and h as text and one as a function; give both alike"
        )
    options: dict[str, Any] = {
        name: getattr(model, name)
        for name in ("outputs", "input_names", "output_names", "output_periods", "sampling_period",
                     "substeps")
    }  # fmt: skip
    rest = {name: value for name, value in known.items() if name not in walks}
    names = None if model.state_names is None else (*model.state_names, *walks)
    options |= {"states": n + q, "inputs": model.inputs, "state_names": names}
    options["parameters"] = rest or None
    if model.state_periods is not None:
        options["state_periods"] = np.concatenate([model.state_periods, np.zeros(q)])
    if model.scale is not None:
        sizes = [abs(known[name]) or 1.0 for name in walks]
        options["scale"] = np.concatenate([model.scale, sizes])
    Q = np.zeros((n + q, n + q))
    walk = np.diag(list(walks.values()))
    Q[:n, :n], Q[n:, n:] = model.Q, model.sampling_period * walk
    if model.density is not None:
        options["density"] = np.block([[model.density, Q[:n, n:]], [Q[n:, :n], walk]])
    if texts:
        still = ["0*" + name if model.substeps else name for name in walks]
        return NonlinearModel((*model.f, *still), model.h, Q, model.R, **options)
    order = np.array([[*walks].index(name) if name in walks else -1 for name in known])
    places = np.array([[*rest].index(name) if name in rest else -1 for name in known])
    made = {}
    for name in ("f", "h"):

        def compiled(function: Any, plain: bool = name in model.uncompiled) -> Any:
            """The function as numba calls it, which calls none but its own."""
            return function if plain or is_jitted(function) else njit(function)

        own = compiled(_of_three(compiled(getattr(model, name)), model.arguments(name)))
        made[name] = _of_all(own, n, order, places)
        if name == "f":
            made[name] = _with_held(compiled(made[name]), n, bool(model.substeps))
        if not rest:
            made[name] = _without_parameters(compiled(made[name]))
    held, h = made["f"], made["h"]
    return NonlinearModel(held, h, Q, model.R, **options)


def _of_three(function: Callable[..., Any], arguments: int) -> Callable[..., Any]:
    """The function, of x, of x and u, or of x, u and p, as one of all three."""
    if arguments == 3:
        return function
    if arguments == 2:
        return lambda x, u, p: function(x, u)
    return lambda x, u, p: function(x)


def _of_all(
    function: Callable[..., Any], n: int, order: NDArray[np.int64], places: NDArray[np.int64]
) -> Callable[..., Any]:
    """The function of [x, theta], u and the other parameters, from one of x, u and all of these.

    ``order`` is the place of each parameter in theta, -1 if it is among the others, at ``places``.
    """

    def of_all(x: Array, u: Array, p: Array) -> Any:
        values = np.empty(len(order))
        for i in range(len(order)):
            values[i] = x[n + order[i]] if order[i] >= 0 else p[places[i]]
        return function(x[:n], u, values)

    return of_all


def _with_held(function: Callable[..., Any], n: int, ode: bool) -> Callable[..., Any]:
    """The function with the parameters behind, held, or with a derivative of zero."""

    def held(x: Array, u: Array, p: Array) -> Array:
        moved, first = np.zeros(len(x)), function(x, u, p)
        for i in range(len(x)):
            if i < n:
                moved[i] = first[i]
            elif not ode:
                moved[i] = x[i]
        return moved

    return held


def _without_parameters(function: Callable[..., Any]) -> Callable[..., Any]:
    none = np.zeros(1)
    return lambda x, u: function(x, u, none)
