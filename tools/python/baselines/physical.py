"""Baselines a and b: friction that is linear in its coefficients, around two velocities that are searched on a grid."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lstsq

SLOPES = np.geomspace(0.002, 0.1, 8)
"""Velocities v_c of tanh(v / v_c), as fractions of the largest training velocity (99 % of the samples are slower)."""
STRIBECK = np.geomspace(0.003, 0.4, 12)
"""Stribeck velocities v_s of exp(-(v / v_s)^2), as fractions of the same."""
SEARCHED = 4_000
"""Most samples that the grids are searched with, evenly thinned; the coefficients are then fitted to all."""


def rms(values):
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def fastest(samples):
    """Velocity below which 99 % of the samples are."""
    return np.percentile(np.abs(samples.velocity), 99)


def thinned(samples):
    """Every n-th sample, at most SEARCHED."""
    return samples.where(slice(None, None, -(-len(samples.effort) // SEARCHED)))


def fitted(columns, target):
    """Coefficients of least squares, and what they leave (RMS). Columns are scaled, so that units do not decide about rank."""
    matrix = np.column_stack(list(columns.values()))
    scale = np.sqrt(np.mean(np.square(matrix), axis=0))
    scale[scale == 0] = 1
    coefficients = lstsq(matrix / scale, target, lapack_driver="gelsy", cond=1e-10, check_finite=False)[0] / scale
    return dict(zip(columns, coefficients)), rms(target - matrix @ coefficients)


def summed(coefficients, columns):
    """The effort that the coefficients predict."""
    return sum(coefficient * columns[name] for name, coefficient in coefficients.items())


@dataclass
class Simple:
    """Baseline a: rigid body, viscous and Coulomb friction, offset."""

    slope: float
    """v_c, unit of the velocity."""
    coefficients: dict
    residual: float
    """RMS on the samples that it was fitted to, unit of the effort."""

    @staticmethod
    def columns(samples, slope):
        """Its regressors."""
        velocity = samples.velocity
        return dict(samples.rigid, viscous=velocity, coulomb=np.tanh(velocity / slope), offset=np.ones(len(velocity)))

    @classmethod
    def fit(cls, samples):
        """The best v_c of the grid, by the samples given."""
        some = thinned(samples)
        made = lambda samples, slope: cls(slope, *fitted(cls.columns(samples, slope), samples.effort))
        found = min((made(some, slope) for slope in SLOPES * fastest(samples)), key=lambda model: model.residual)
        return made(samples, found.slope)

    def load(self, samples):
        """Load torque: the rigid body's part, never the measured effort."""
        return sum((self.coefficients[name] * values for name, values in samples.rigid.items()),
                   np.zeros(len(samples.velocity)))

    def predict(self, samples):
        """The effort of each sample."""
        return summed(self.coefficients, self.columns(samples, self.slope))


@dataclass
class Extended:
    """Baseline b: a with asymmetric, Stribeck, quadratic, load-dependent and temperature terms."""

    simple: Simple
    slope: float
    """v_c, unit of the velocity; not that of a, which stands in for a Stribeck velocity there."""
    stribeck: float
    """v_s, unit of the velocity."""
    temperature: float
    """Mean temperature of the samples that it was fitted to, degrees Celsius; 0 where none was recorded."""
    coefficients: dict
    residual: float

    @staticmethod
    def columns(samples, simple, slope, stribeck, temperature):
        """Its regressors."""
        velocity, columns = samples.velocity, Simple.columns(samples, slope)
        sign, slow = columns["coulomb"], np.exp(-((velocity / stribeck) ** 2))
        load = np.abs(simple.load(samples))
        columns.update(viscous_asymmetry=np.abs(velocity), coulomb_asymmetry=np.abs(sign), stribeck=sign * slow,
                       quadratic=velocity * np.abs(velocity), load=sign * load, stribeck_load=sign * load * slow)
        if samples.temperature is not None:
            warmer = (samples.temperature - temperature) / 10
            columns.update(viscous_temperature=velocity * warmer, coulomb_temperature=sign * warmer,
                           offset_temperature=warmer)
        return columns

    @classmethod
    def fit(cls, samples, simple):
        """The best pair of v_c and v_s of the grids, by the samples given; `simple` is a, fitted to the same."""
        temperature = 0.0 if samples.temperature is None else float(samples.temperature.mean())
        some = thinned(samples)

        def made(samples, slope, stribeck):
            columns = cls.columns(samples, simple, slope, stribeck, temperature)
            return cls(simple, slope, stribeck, temperature, *fitted(columns, samples.effort))

        grid = ((slope, stribeck) for slope in SLOPES for stribeck in STRIBECK)
        tried = (made(some, *(np.array(pair) * fastest(samples))) for pair in grid)
        found = min(tried, key=lambda model: model.residual)
        return made(samples, found.slope, found.stribeck)

    def predict(self, samples):
        """The effort of each sample."""
        columns = self.columns(samples, self.simple, self.slope, self.stribeck, self.temperature)
        return summed(self.coefficients, columns)
