"""A joint with known parameters as the baselines see it."""

import numpy as np

from baselines.samples import Samples

INERTIA, GRAVITY, VISCOUS, COULOMB, OFFSET = 0.4, 2.0, 0.3, 1.5, 0.2
NOISE = 0.05


def joint(friction=lambda samples, load: 0, count=6000, noise=NOISE, temperature=None):
    """A joint that follows sines, and `friction` (of the samples and the rigid body's torque) beside viscous and Coulomb
    friction. The first half trains, then validation and test get a quarter each."""
    time = np.arange(count) * 0.01
    position, velocity, acceleration = np.zeros((3, count))
    for frequency, amplitude in ((0.7, 0.8), (1.9, 0.3), (3.1, 0.15)):
        phase = frequency * time
        position += amplitude * np.sin(phase)
        velocity += amplitude * frequency * np.cos(phase)
        acceleration -= amplitude * frequency**2 * np.sin(phase)
    part = np.repeat(["train", "validation", "test"], [count // 2, count // 4, count - count // 2 - count // 4])
    rigid = {"inertia": acceleration, "gravity_sine": np.sin(position)}
    samples = Samples("Nm", part, {"last quarter": part == "test"}, position, velocity, np.zeros(count), temperature,
                      rigid, {})
    load = INERTIA * acceleration + GRAVITY * np.sin(position)
    samples.effort = (load + VISCOUS * velocity + COULOMB * np.tanh(velocity / (0.02 * np.abs(velocity).max())) + OFFSET
                      + friction(samples, load) + noise * np.random.default_rng(7).standard_normal(count))
    return samples
