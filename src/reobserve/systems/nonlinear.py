"""A nonlinear model in discrete time with Gaussian noise, the model of nonlinear filters.

The functions are given in Python or as text. Parameters p of the functions are values at run time:
compiled functions take them behind the input, as one vector v = [u, p].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import MOST_STATES, as_whole
from reobserve.core.covariances import as_covariance
from reobserve.core.errors import InputError
from reobserve.core.matrices import as_floats, as_positive
from reobserve.core.value import for_loop, read_only
from reobserve.systems.nonlinear_arguments import as_parameters, as_scale, as_texts
from reobserve.systems.nonlinear_flow import Functions
from reobserve.systems.nonlinear_text import Names, text_jacobian, text_rows
from reobserve.systems.parameter_states import with_parameter_states
from reobserve.systems.periods import Periods, as_periods
from reobserve.systems.signal_names import as_names
from reobserve.systems.text_functions import compiled_rows
from reobserve.systems.user_function import UserFunction

Array = NDArray[np.float64]
Function = Callable[..., Any] | str | Sequence[str]
JacobianFunction = Callable[..., Any] | Sequence[Sequence[str]]


@dataclass(frozen=True, eq=False, repr=False)
class NonlinearModel:
    """A nonlinear model in discrete time with Gaussian noise.

        x(k+1) = f(x(k), u(k)) + w(k)             w ~ N(0, Q)
        y(k)   = h(x(k), u(k)) + v(k)             v ~ N(0, R)

    `from_ode` integrates x' = f(x, u) over a sampling period with u held.

    Parameters
    ----------
    f
        The next state: a function ``f(x, u)`` in Python that returns n numbers, or n texts, such as
        ``["angle + 0.01*rate", "rate - 0.1*sin(angle)"]``, in the grammar of
        `reobserve.polynomials.grammar`. It may be a function of x alone, or ``f(x, u, p)``, where p
        is the array of the values of ``parameters``, in their order; an argument that has a default
        is never given p.
    h
        The measurements: a function ``h(x, u)``, of x alone, or ``h(x, u, p)``, that returns m
        numbers; or m texts.
    Q
        Covariance of the process noise over a sampling period: a number, n numbers or (n, n);
        positive semidefinite.
    R
        Covariance of the measurement noise: a number, m numbers or (m, m); semidefinite.
    F, H
        The Jacobians df/dx, (n, n), and dh/dx, (m, n), as functions like f and h, or as rows of
        texts. Left out, those of texts are derived symbolically, and those of Python functions by
        central differences of fourth order, good to about twelve digits (``scale``). The unscented
        filter uses none.
    states, inputs, outputs
        n, p and m. They may be left out where names or texts tell them; inputs are none then.
    state_names, input_names, output_names
        Names of the signals, which texts are written in and runs are labelled with. Texts need
        those of states and of inputs; other names may be left out.
    state_periods, output_periods
        Of angles, as `LinearModel` has them; then f and h must be the same after a period.
    parameters
        Values by name: of further names in texts, and of p in Python functions. They are read at
        run time, so that a model with other values compiles nothing.
    scale
        Typical sizes of the states, one number or n, for the steps of differences; left out, these
        are found from the estimate.
    sampling_period
        [s]; left out, time is counted in samples.
    substeps
        Left at 0, f is the next state. `from_ode` sets the number of Runge-Kutta steps.
    density
        Left out; `from_ode` sets the spectral density of the noise.

    Raises
    ------
    InputError
        If a function returns another number of values; a text cannot be read; sizes do not fit; Q
        or R is not symmetric positive semidefinite; the period or a scale is not positive; or a
        density is not that of Q.

    Notes
    -----
    Python functions are compiled by numba where it can, so that global variables keep the values
    they have at the model's first use. Code is compiled once a process: a model of the same texts,
    or of a function of which nothing that it names has changed, is made in less than a millisecond.
    Other functions are called from Python, some microseconds a call, with the same results; the
    model's text, ``repr(model)``, and `uncompiled` say which.

    Examples
    --------
    >>> from reobserve import NonlinearModel
    >>> pendulum = NonlinearModel.from_ode(
    ...     ["rate", "-9.81*sin(angle)"], ["angle"], Q=1e-6, R=1e-4,
    ...     state_names=["angle", "rate"], sampling_period=0.1,
    ... )
    >>> print(pendulum.states, pendulum.inputs, pendulum.outputs)
    2 0 1
    """

    f: Any
    h: Any
    Q: Array
    R: Array
    _: KW_ONLY
    F: Any = None
    H: Any = None
    states: int = None  # type: ignore[assignment]  # a number, once it is made
    inputs: int = None  # type: ignore[assignment]
    outputs: int = None  # type: ignore[assignment]
    state_names: tuple[str, ...] | None = None
    input_names: tuple[str, ...] | None = None
    output_names: tuple[str, ...] | None = None
    state_periods: Array | None = None
    output_periods: Array | None = None
    parameters: Mapping[str, float] | None = None
    scale: Array | None = None
    sampling_period: float = 1.0
    substeps: int = 0
    density: Array | None = None

    if TYPE_CHECKING:  # what it takes is wider than what it then holds

        def __init__(
            self, f: Function, h: Function, Q: ArrayLike, R: ArrayLike,
            *, F: JacobianFunction | None = ..., H: JacobianFunction | None = ...,
            states: int | None = ..., inputs: int | None = ..., outputs: int | None = ...,
            state_names: Sequence[str] | None = ..., input_names: Sequence[str] | None = ...,
            output_names: Sequence[str] | None = ..., state_periods: Periods | None = ...,
            output_periods: Periods | None = ..., parameters: Mapping[str, float] | None = ...,
            scale: ArrayLike | None = ..., sampling_period: float = ..., substeps: int = ...,
            density: ArrayLike | None = ...,
        ) -> None: ...  # fmt: skip

    def __post_init__(self) -> None:
        put = object.__setattr__
        for name in ("f", "h"):
            put(self, name, as_texts(name, getattr(self, name)))
        lengths = {
            "state": len(self.f) if isinstance(self.f, tuple) else None,
            "input": None,
            "output": len(self.h) if isinstance(self.h, tuple) else None,
        }
        for kind, length in lengths.items():
            names = as_names(f"{kind}_names", getattr(self, f"{kind}_names"))
            count = length if names is None else len(names)
            given, least = getattr(self, f"{kind}s"), 0 if kind == "input" else 1
            if given is None and count is None and kind != "input":
                raise InputError(f"{kind}s", "is left out, must be the number of them")
            size = count or 0
            if given is not None:
                size = as_whole(f"{kind}s", given, least, MOST_STATES)
            if names is not None and len(names) != size:
                raise InputError(f"{kind}_names", f"are {len(names)}, must be {size}")
            if length is not None and length != size:
                raise InputError("fh"[kind == "output"], f"has {length} texts, must have {size}")
            put(self, f"{kind}_names", names)
            put(self, f"{kind}s", size)
            if kind != "input":
                key = f"{kind}_periods"
                periods = as_periods(key, getattr(self, key), size, names)
                put(self, key, None if periods is None else read_only(periods))
        as_names("input_names", list(self._variables))  # of which none may be a state's
        put(self, "parameters", as_parameters(self.parameters, self._variables))
        put(self, "Q", read_only(as_covariance("Q", self.Q, self.states)))
        put(self, "R", read_only(as_covariance("R", self.R, self.outputs)))
        if self.scale is not None:
            put(self, "scale", read_only(as_scale(self.scale, self.states)))
        put(self, "sampling_period", as_positive("sampling_period", self.sampling_period))
        put(self, "substeps", as_whole("substeps", self.substeps, 0, 10_000))
        if self.density is not None:
            density = as_covariance("density", self.density, self.states)
            if not np.allclose(self.Q, self.sampling_period * density, rtol=1e-9, atol=0.0):
                problem = "times the sampling period is not Q: leave it out, or give it to from_ode"
                raise InputError("density", problem)
            put(self, "density", read_only(density))
        _ = self._definitions  # refuses what is no function now and not at the first step

    @classmethod
    def from_ode(
        cls, f: Function, h: Function, *, Q: ArrayLike | None = None, R: ArrayLike = None,  # type: ignore[assignment]
        F: JacobianFunction | None = None, H: JacobianFunction | None = None,
        density: ArrayLike | None = None, sampling_period: float, substeps: int = 1,
        states: int | None = None, inputs: int | None = None, outputs: int | None = None,
        state_names: Sequence[str] | None = None, input_names: Sequence[str] | None = None,
        output_names: Sequence[str] | None = None, state_periods: Periods | None = None,
        output_periods: Periods | None = None, parameters: Mapping[str, float] | None = None,
        scale: ArrayLike | None = None,
    ) -> NonlinearModel:  # fmt: skip
        """The model of x' = f(x, u), y = h(x, u), with u held over each sampling period.

        It is integrated by the classical Runge-Kutta method; the Jacobian of a step is that of the
        method itself.

        Parameters
        ----------
        f, h, F, H
            As in the class, but f is x', and F its Jacobian.
        Q
            Covariance of the noise that a sampling period adds to the state.
        density
            In place of Q: spectral density of white noise on x', in units of Q per second; a
            number, n numbers or (n, n). With it filters take samples at any times. The noise of a
            period T is density times T, which is exact for short periods. A longer time between
            two rows is predicted in equal parts of a period at most.
        sampling_period
            [s].
        substeps
            Steps of the method in a sampling period.
        R, states, inputs, outputs, state_names, input_names, output_names, parameters, scale
            As in the class.
        state_periods, output_periods
            Of angles, as in the class.

        Raises
        ------
        InputError
            As the class; or if both Q and the density are given, or none.
        """
        steps = as_whole("substeps", substeps, 1, 10_000)
        if (Q is None) == (density is None):
            problem = "is given beside Q" if density is not None else "is left out, and so is Q"
            raise InputError("density", f"{problem}; must be exactly one of both")
        if density is not None:
            Q = as_positive("sampling_period", sampling_period) * as_floats("density", density)
        return cls(
            f, h, Q, R, F=F, H=H, states=states, inputs=inputs, outputs=outputs,  # type: ignore[arg-type]
            state_names=state_names, input_names=input_names, output_names=output_names,
            state_periods=state_periods, output_periods=output_periods, parameters=parameters,
            scale=scale, sampling_period=sampling_period, substeps=steps, density=density,
        )  # fmt: skip

    @property
    def continuous(self) -> bool:
        """True if it is of a differential equation, which can be integrated over any time."""
        return self.substeps > 0

    @cached_property
    def steps(self) -> Array | None:
        """The length [s] of Runge-Kutta steps, or None where f is the next state."""
        return np.array([self.sampling_period / self.substeps]) if self.substeps else None

    def __repr__(self) -> str:
        numbers = {"state": self.states, "input": self.inputs, "output": self.outputs}
        size = ", ".join(
            f"{number} {kind}{'s' * (number != 1)}" for kind, number in numbers.items()
        )
        text = all(isinstance(function, tuple) for function in (self.f, self.h))
        how = "from text, compiled" if text else "compiled"
        if self.uncompiled:
            how = f"{' and '.join(self.uncompiled)} called from Python"
        ending = "s" if self.substeps != 1 else ""
        ode = f", {self.substeps} Runge-Kutta step{ending}" if self.substeps else ""
        return f"NonlinearModel({size}, sampling_period={self.sampling_period:g}{ode}; {how})"

    def __getstate__(self) -> dict[str, Any]:
        """The content of a pickle: functions are compiled again."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the q parameters, in the order of their values, () if there are none."""
        return tuple(self.parameters or ())

    @cached_property
    def parameter_values(self) -> Array:
        """Values of the parameters, shape (q,), read-only."""
        return read_only(np.array([*(self.parameters or {}).values()], dtype=np.float64))

    def with_parameter_states(self, random_walk: Mapping[str, float]) -> NonlinearModel:
        """The model of the state and parameters of this one, which a filter then estimates.

            x(k+1) = f(x(k), u(k), theta(k)) + w(k),    theta(k+1) = theta(k) + n(k)

        The state is [x, theta]; other parameters stay parameters (Jazwinski 1970, Section 8.4).
        Jacobians that were given are found again, from text or by differences.

        Parameters
        ----------
        random_walk
            By the name of a parameter the variance that it gains in a second: n has that times the
            sampling period. With zero it is constant, and its estimate comes to rest.

        Raises
        ------
        InputError
            If a name is no parameter, a variance is negative, or one of f and h is text and the
            other is not.

        Examples
        --------
        >>> from reobserve import NonlinearModel
        >>> pendulum = NonlinearModel.from_ode(
        ...     ["rate", "-9.81/length*sin(angle)"], ["angle"], Q=1e-8, R=1e-6,
        ...     state_names=["angle", "rate"], parameters={"length": 1.0}, sampling_period=0.05,
        ... )
        >>> print(pendulum.with_parameter_states({"length": 0.0}).state_names)
        ('angle', 'rate', 'length')
        """
        return with_parameter_states(self, random_walk)

    def arguments(self, name: str) -> int:
        """The number of arguments that a Python function is called with, of x, u and p."""
        return getattr(self._definitions[name], "arguments", 0)

    @property
    def uncompiled(self) -> dict[str, str]:
        """Functions that are called from Python, by name, and why numba cannot compile them."""
        return {name: why for name, (_, why) in self._pointers.items() if why}

    @property
    def _variables(self) -> tuple[str, ...]:
        return (*(self.state_names or ()), *(self.input_names or ()))

    @cached_property
    def _definitions(self) -> dict[str, UserFunction | tuple[str, ...]]:
        """The definitions to compile, by name: Python functions, or expressions as Python code."""
        n, p, m = self.states, self.inputs, self.outputs
        shapes: dict[str, tuple[int, ...]] = {"f": (n,), "h": (m,), "F": (n, n), "H": (m, n)}
        definitions: dict[str, UserFunction | tuple[str, ...]] = {}
        for name, shape in shapes.items():
            given = getattr(self, name)
            if given is None:
                continue
            if callable(given):
                values = tuple((self.parameters or {}).values())
                definitions[name] = UserFunction(name, given, n, p, shape, values)
            else:
                definitions[name] = text_rows(name, given, shape, self._text_names)
        return definitions

    @property
    def _text_names(self) -> Names:
        if self.state_names is None:
            raise InputError("state_names", "are left out, must name what the texts are of")
        if self.input_names is None and self.inputs:
            raise InputError("input_names", "are left out, must name what the texts are of")
        return Names(self.state_names, self.input_names or (), self.parameter_names)

    @cached_property
    def _pointers(self) -> dict[str, tuple[Any, str]]:
        """Pointers of what is defined, for compiled loops, and reasons why one is not compiled."""
        return {
            name: made.compiled() if isinstance(made, UserFunction) else (compiled_rows(made), "")
            for name, made in self._definitions.items()
        }

    @cached_property
    def _jacobians(self) -> dict[str, Any]:
        """Pointers to the Jacobians that are given or can be derived from text."""
        given, jacobians = self._pointers, {}
        for name in "FH":
            code = self.code(name)
            if name in given:
                jacobians[name] = given[name][0]
            elif code is not None:
                jacobians[name] = compiled_rows(code)
        return jacobians

    def code(self, name: str) -> tuple[str, ...] | None:
        """Expressions of f, h, F or H, row by row, as Python, or None of functions in Python.

        They are in ``x`` and ``parameters``, which holds the inputs, then the parameters.
        """
        function, known = getattr(self, name.lower()), self._definitions.get(name)
        if known is None and isinstance(function, tuple):
            return text_jacobian(name.lower(), function, self._text_names)
        return known if isinstance(known, tuple) else None

    @cached_property
    def functions(self) -> Functions:
        """The model as compiled loops read it."""
        return self._functions(self._jacobians)

    @cached_property
    def functions_alone(self) -> Functions:
        """The model's `functions`, without Jacobians."""
        return self._functions({})

    def _functions(self, jacobians: Mapping[str, Any]) -> Functions:
        f, h = self._pointers["f"][0], self._pointers["h"][0]
        F, H = (jacobians.get(name) for name in "FH")
        scale = np.zeros(self.states) if self.scale is None else self.scale
        numeric = [None if jacobian is not None else True for jacobian in (F, H)]
        return Functions(f, F, h, H, self.substeps, for_loop(scale), *numeric)
