from typing import Literal, Sequence

import numpy as np
from numpy.typing import NDArray

__version__: str

class Model:
    """State-space model in innovation form; describes deviations from the operating point."""

    @property
    def A(self) -> NDArray[np.float64]: ...
    @property
    def B(self) -> NDArray[np.float64]: ...
    @property
    def C(self) -> NDArray[np.float64]: ...
    @property
    def D(self) -> NDArray[np.float64]: ...
    @property
    def K(self) -> NDArray[np.float64]: ...
    @property
    def innovation_covariance(self) -> NDArray[np.float64] | None: ...
    @property
    def covariance(self) -> NDArray[np.float64] | None: ...
    @property
    def dt(self) -> float: ...
    @property
    def order(self) -> int: ...
    @property
    def warnings(self) -> list[str]: ...
    def to_json(self) -> str: ...

def identify(
    u: NDArray[np.float64],
    y: NDArray[np.float64],
    *,
    dt: float,
    method: str = "pbsid-opt",
    stochastic: str | None = None,
    order: int | None = None,
    past: int | None = None,
    future: int | None = None,
    weight: Literal["identity", "cva"] | None = None,
    polish: Literal["auto", "always", "never"] = "auto",
    covariance: Literal["model", "robust"] = "model",
    detrend: Literal["mean", "linear", "none"] = "mean",
    feedthrough: bool = False,
    delay: Sequence[int] = (),
    stable: bool = False,
    seed: int = 0,
) -> Model: ...
