"""State updates per second of scipy.integrate.solve_ivp on the plant of benches/simulation.rs, with its ten sensitivities.

    python benches/simulation_scipy.py [SAMPLES]

The sine that `linear_input` has on straight lines between samples is given as a function here, so that steps may be longer than
a sample; held inputs would need a call for each sample. Right-hand side and Jacobians are written by hand with numpy.
"""

import os
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
import numpy as np
import scipy
from scipy.integrate import solve_ivp

R, L, k, J1, J2, d1, d2, c, c3, d = 1.5, 0.03, 0.06, 3e-4, 8e-4, 1e-4, 5e-4, 0.8, 2.0, 2e-4
SAMPLE_TIME = 1e-3
STATES, PARAMETERS = 5, 10


def field(t, x):
    i, w1, w2, p1, p2 = x
    e = p1 - p2
    tau = c * e + c3 * e**3 + d * (w1 - w2)
    u = 6 * np.sin(3 * t)
    return np.array(
        [(u - R * i - k * w1) / L, (k * i - d1 * w1 - tau) / J1, (tau - d2 * w2) / J2, w1, w2]
    )


def field_with_sensitivities(t, z):
    x, s = z[:STATES], z[STATES:].reshape(STATES, PARAMETERS)
    i, w1, w2, p1, p2 = x
    f = field(t, x)
    e = p1 - p2
    stiffness = c + 3 * c3 * e**2
    jacobian = np.array(
        [
            [-R / L, -k / L, 0, 0, 0],
            [k / J1, -(d1 + d) / J1, d / J1, -stiffness / J1, stiffness / J1],
            [0, d / J2, -(d2 + d) / J2, stiffness / J2, -stiffness / J2],
            [0, 1, 0, 0, 0],
            [0, 0, 1, 0, 0],
        ]
    )
    by_parameter = np.zeros((STATES, PARAMETERS))
    by_parameter[0, :3] = -i / L, -f[0] / L, -w1 / L
    by_parameter[1, 2:4] = i / J1, -f[1] / J1
    by_parameter[1, 5] = -w1 / J1
    by_parameter[1, 7:] = -e / J1, -(e**3) / J1, -(w1 - w2) / J1
    by_parameter[2, 4] = -f[2] / J2
    by_parameter[2, 6:] = -w2 / J2, e / J2, e**3 / J2, (w1 - w2) / J2
    return np.concatenate([f, (jacobian @ s + by_parameter).ravel()])


def main():
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    times = SAMPLE_TIME * np.arange(samples)
    print(f"scipy {scipy.__version__}, numpy {np.__version__}, {samples} samples")
    for name, right, size in [
        ("states", field, STATES),
        ("states and ten sensitivities", field_with_sensitivities, STATES * (1 + PARAMETERS)),
    ]:
        for method in ["RK45", "LSODA"]:
            best = np.inf
            for _ in range(3):
                start = time.process_time()
                run = solve_ivp(
                    right, (0, times[-1]), np.zeros(size), method, times, rtol=1e-6, atol=1e-9
                )
                best = min(best, time.process_time() - start)
            assert run.success
            rate = STATES * samples / best
            print(f"{name}, {method}: {best:.3f} s, {rate:.3g} state updates a second")


if __name__ == "__main__":
    main()
