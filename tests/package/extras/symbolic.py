"""With the extra `symbolic`: right-hand sides as text, and normal forms."""

from reobserve import ExtendedKalmanFilter, NonlinearModel, normal_form_observer
from reobserve.systems.triangular_text import triangular_model

motion = ["w", "-sin(a)"]
normal_form_observer(motion, ["a"], ["a", "w"], poles=[-1.5, -2], order=3, sampling_period=0.01)
pendulum = NonlinearModel.from_ode(
    motion, ["a"], Q=1e-8, R=1e-6, state_names=["a", "w"], sampling_period=0.01
)
ExtendedKalmanFilter(pendulum)
triangular_model(["a", "w"], ["0", "-sin(a)"], "1")
