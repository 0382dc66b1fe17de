"""Time of `innovant.identify` on arrays against the same call from Rust, and against other packages on the same data.

Usage: python benches/compare_python.py [samples, default 1000000]

Needs the wheel (`pip install ./python`); ctrlsys (SLICOT), nfoursid and sippy-unipi are measured where they are
installed. Data: van Wingerden's Example I (two inputs, two outputs, order 4), in open loop, because the others are
not made for feedback, with the innovations of the paper. Accuracy: largest relative error of the frequency response
over 100 frequencies; every package is told the order. Packages that need more time or memory than `LIMIT` samples
allow get the first `LIMIT[name]` samples, and innovant gets the same for comparison.
"""

import os
import subprocess
import sys
import time
import warnings
from pathlib import Path

# One thread each, before numpy is loaded.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np  # noqa: E402

import innovant  # noqa: E402

ROOT = Path(__file__).parent.parent
PAST = 20
ORDER = 4
#: Samples that a package is given at most: beyond it takes minutes or the memory of a workstation.
LIMIT = {"ctrlsys": 1_000_000, "nfoursid": 3_000, "sippy": 20_000}

A = np.array([[0.67, 0.67, 0, 0], [-0.67, 0.67, 0, 0], [0, 0, -0.67, -0.67], [0, 0, 0.67, -0.67]])
B = np.array([[0.6598, 1.9698], [-0.5256, 0.4845], [-0.6968, 0.1722], [0.1474, 0.5646]])
K = np.array([[-0.6968, -0.1474], [0.1722, 0.5646], [0.6484, -0.4660], [-0.94, 0.1032]])
C = np.array([[-0.3749, 0.0751, -0.5225, 0.5830], [-0.8977, 0.7543, 0.1159, 0.0982]])
OMEGA = np.linspace(0.02, 3.1, 100)


def record(samples):
    rng = np.random.default_rng(1)
    u, e = rng.standard_normal((2, samples, 2))
    x, y = np.zeros(4), np.empty((samples, 2))
    drive = u @ B.T + e @ K.T
    for k in range(samples):
        y[k] = C @ x
        x = A @ x + drive[k]
    return u, y + e


def response(a, b, c, d):
    return np.array([c @ np.linalg.solve(np.exp(1j * w) * np.eye(len(a)) - a, b) + d for w in OMEGA])


def error(a, b, c, d):
    true = response(A, B, C, np.zeros((2, 2)))
    scale = np.linalg.norm(true, axis=(1, 2))
    return np.max(np.linalg.norm(response(a, b, c, d) - true, axis=(1, 2)) / scale)


def fastest(call, runs=15):
    """The best of a few runs (of slow calls fewer), and what the last one gave."""
    best = np.inf
    for _ in range(runs):
        started = time.perf_counter()
        result = call()
        best = min(best, time.perf_counter() - started)
        if best > 10:
            break
    return best, result


def ours(u, y, **options):
    seconds, model = fastest(lambda: innovant.identify(u, y, dt=1.0, order=ORDER, **options))
    return seconds, error(model.A, model.B, model.C, model.D)


def ctrlsys(u, y):
    """SLICOT: IB01AD by Cholesky, the fastest it has, and IB01BD, MOESP and N4SID combined, the best of the three."""
    import ctrlsys as slicot

    inputs, outputs = np.asfortranarray(u), np.asfortranarray(y)

    def run():
        _, r, *_ = slicot.ib01ad("N", "C", "N", "O", "N", "N", PAST, 2, 2, inputs, outputs, 0.0, 0.0)
        a, c, b, d, *_ = slicot.ib01bd("C", "A", "N", PAST, ORDER, 2, 2, len(u), r, 0.0)
        return a, b, c, d

    seconds, system = fastest(run)
    return seconds, error(*system)


def nfoursid(u, y):
    import pandas
    from nfoursid.nfoursid import NFourSID

    frame = pandas.DataFrame(np.hstack([u, y]), columns=["u1", "u2", "y1", "y2"])

    def run():
        method = NFourSID(frame, output_columns=["y1", "y2"], input_columns=["u1", "u2"], num_block_rows=PAST)
        method.subspace_identification()
        return method.system_identification(rank=ORDER)[0]

    seconds, system = fastest(run)
    return seconds, error(system.a, system.b, system.c, system.d)


def sippy(u, y):
    from sippy_unipi import system_identification

    def run():
        return system_identification(
            y.T, u.T, "N4SID", SS_f=PAST, SS_p=PAST, SS_fixed_order=ORDER, SS_D_required=False
        )

    seconds, system = fastest(run)
    return seconds, error(np.asarray(system.A), np.asarray(system.B), np.asarray(system.C), np.asarray(system.D))


def rust(samples):
    """Seconds of the same call from Rust, on arrays in memory: identification alone, and with the residual tests."""
    command = ["cargo", "run", "--release", "--quiet", "--example", "time_identify", "--", str(samples), str(PAST)]
    said = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [float(number) for number in said.split()]


def main():
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    warnings.simplefilter("ignore")
    u, y, _ = innovant.examples.closed_loop(samples)
    here, _ = fastest(lambda: innovant.identify(u, y, dt=1.0, past=PAST))
    plain, tested = rust(samples)
    with_tests, _ = fastest(lambda: innovant.identify(u, y, dt=1.0, past=PAST).residual_tests)
    print(f"{samples} samples x 4 channels, past window {PAST}, order chosen, with covariance:")
    print(f"  Python {here:.3f} s, Rust {plain:.3f} s: {here / plain:.2f} times")
    print(f"  and with the residual tests: Python {with_tests:.3f} s, Rust {tested:.3f} s: {with_tests / tested:.2f} times")

    u, y = record(samples)
    print("the same plant in open loop, order 4 given; largest relative error of the frequency response:")
    print(f"  {'innovant':<10} {samples:>8} samples  {'%8.3f s  %.2e' % ours(u, y, past=PAST)}")
    for name, run in (("ctrlsys", ctrlsys), ("nfoursid", nfoursid), ("sippy", sippy)):
        count = min(samples, LIMIT[name])
        try:
            seconds, wrong = run(u[:count], y[:count])
        except ImportError as missing:
            print(f"  {name:<10} is not installed ({missing})")
            continue
        print(f"  {name:<10} {count:>8} samples  {seconds:8.3f} s  {wrong:.2e}")
        if count < samples:
            print(f"  {'innovant':<10} {count:>8} samples  {'%8.3f s  %.2e' % ours(u[:count], y[:count], past=PAST)}")


if __name__ == "__main__":
    main()
