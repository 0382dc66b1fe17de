"""One model from a fleet's recordings, each in chunks, reduced on a Dask cluster where the data are.

Run: python fleet_on_dask.py
"""

import dask
import numpy as np
from dask.distributed import Client, LocalCluster

import innovant
import innovant.dask

MACHINES = 6
CHUNKS = 4
CHUNK = 2500


@dask.delayed
def load(machine, chunk):
    """In earnest: read a part of a machine's log. Here it is simulated."""
    u, y, _ = innovant.examples.closed_loop(CHUNKS * CHUNK, seed=machine)
    rows = slice(chunk * CHUNK, (chunk + 1) * CHUNK)
    return u[rows], y[rows]


def main():
    fleet = [[load(machine, chunk) for chunk in range(CHUNKS)] for machine in range(MACHINES)]
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster):
        together = innovant.dask.identify(fleet, dt=1.0)
        alone = innovant.dask.identify(fleet[0], dt=1.0)
    print(together.verdict)
    for name, model in (("one machine", alone), ("the fleet", together)):
        poles = model.poles()
        print(f"{name}: {poles.natural_frequency[0]:.4f} +- {poles.natural_frequency_std[0]:.4f} rad/s")
    # The same from all samples in one place.
    recordings = [innovant.examples.closed_loop(CHUNKS * CHUNK, seed=machine) for machine in range(MACHINES)]
    here = innovant.identify([r[0] for r in recordings], [r[1] for r in recordings], dt=1.0)
    difference = np.abs(here.A - together.A).max()
    print(f"largest difference in A from a single machine: {difference:.1e}")
    return together, alone, difference


if __name__ == "__main__":
    main()
