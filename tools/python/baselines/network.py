"""Baseline c's network: tanh layers and a linear output, trained by Levenberg-Marquardt, stopped by validation samples."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

LAYERS = (5, 5, 5)
DECAY = 1e-4
"""Penalty on the sum of squared weights, beside the sum of squared errors in units of the target's deviation."""
PATIENCE = 20
"""Steps without a lower validation error after which training stops."""


class Network:
    """A network of `inputs` inputs; weights drawn from `seed`."""

    def __init__(self, inputs, seed):
        sizes = (inputs, *LAYERS, 1)
        self.shapes = list(zip(sizes[:-1], sizes[1:]))
        random = np.random.default_rng(seed)
        layers = ((random.standard_normal((n, m)) / np.sqrt(n), 0.3 * random.standard_normal(m)) for n, m in self.shapes)
        self.weights = np.concatenate([part.ravel() for layer in layers for part in layer])

    def layers(self, weights):
        """Matrix and bias of each layer."""
        at = 0
        for n, m in self.shapes:
            yield weights[at:at + n * m].reshape(n, m), weights[at + n * m:at + n * m + m]
            at += n * m + m

    def activations(self, inputs, weights):
        """Inputs, hidden layers and output, each of shape (samples, width)."""
        found = [inputs]
        for layer, (matrix, bias) in enumerate(self.layers(weights)):
            sums = found[-1] @ matrix + bias
            found.append(np.tanh(sums) if layer < len(LAYERS) else sums)
        return found

    def __call__(self, inputs, weights=None):
        """Output for each row of `inputs`."""
        return self.activations(inputs, self.weights if weights is None else weights)[-1][:, 0]

    def derivatives(self, inputs, weights):
        """Output, and its derivatives by all weights, of shape (samples, weights)."""
        found, matrices = self.activations(inputs, weights), [matrix for matrix, _ in self.layers(weights)]
        back, parts = np.ones((len(inputs), 1)), []
        for layer in reversed(range(len(matrices))):
            parts += [back, (found[layer][:, :, None] * back[:, None, :]).reshape(len(inputs), -1)]
            if layer:
                back = (back @ matrices[layer].T) * (1 - found[layer] ** 2)
        return found[-1][:, 0], np.concatenate(parts[::-1], axis=1)

    def train(self, train, validation, steps):
        """Levenberg-Marquardt on (inputs, targets); keeps the weights of the lowest validation error, which it returns."""
        weights, damping = self.weights, 1e-2
        best, since = (np.inf, weights), 0
        for _ in range(steps):
            output, jacobian = self.derivatives(train[0], weights)
            errors = train[1] - output
            cost = errors @ errors + DECAY * weights @ weights
            hessian = jacobian.T @ jacobian + DECAY * np.eye(len(weights))
            gradient = jacobian.T @ errors - DECAY * weights
            for _ in range(30):
                try:
                    step = cho_solve(cho_factor(hessian + damping * np.diag(np.diag(hessian) + 1e-9)), gradient)
                except LinAlgError:
                    damping *= 4
                    continue
                tried = weights + step
                errors = train[1] - self(train[0], tried)
                if errors @ errors + DECAY * tried @ tried < cost:
                    break
                damping *= 4
            else:
                break
            weights, damping = tried, max(damping / 5, 1e-9)
            error = float(np.sqrt(np.mean((validation[1] - self(validation[0], weights)) ** 2)))
            since = 0 if error < 0.9995 * best[0] else since + 1
            if error < best[0]:
                best = (error, weights)
            if since > PATIENCE:
                break
        self.weights = best[1]
        return best[0]


@dataclass
class Corrected:
    """Baseline c: b and a network on what b leaves."""

    simple: object
    extended: object
    network: Network
    mean: np.ndarray
    deviation: np.ndarray
    scale: float
    validation: list
    """Lowest validation error of each seed, unit of the effort."""

    @staticmethod
    def inputs(samples, simple):
        """Position, velocity, load torque and (where recorded) temperature."""
        columns = [samples.position, samples.velocity]
        columns += [simple.load(samples)] if samples.rigid else []
        columns += [] if samples.temperature is None else [samples.temperature]
        return np.column_stack(columns)

    @classmethod
    def fit(cls, train, validation, simple, extended, seeds, most, steps):
        """Networks of `seeds` seeds, each on at most `most` training samples and half as many for validation, drawn at random."""
        random = np.random.default_rng(1)

        def drawn(samples, count):
            inputs, targets = cls.inputs(samples, simple), samples.effort - extended.predict(samples)
            if len(targets) <= count:
                return inputs, targets
            rows = np.sort(random.choice(len(targets), count, replace=False))
            return inputs[rows], targets[rows]

        (inputs, targets), (checked, expected) = drawn(train, most), drawn(validation, most // 2)
        mean, deviation, scale = inputs.mean(axis=0), inputs.std(axis=0), float(targets.std()) or 1.0
        deviation[deviation == 0] = 1
        normal = lambda rows: (rows - mean) / deviation
        found = []
        for seed in range(seeds):
            network = Network(inputs.shape[1], seed)
            error = network.train((normal(inputs), targets / scale), (normal(checked), expected / scale), steps)
            found.append((error * scale, network))
        best = min(found, key=lambda one: one[0])[1]
        return cls(simple, extended, best, mean, deviation, scale, [error for error, _ in found])

    def predict(self, samples):
        """The effort of each sample."""
        inputs = (self.inputs(samples, self.simple) - self.mean) / self.deviation
        return self.extended.predict(samples) + self.network(inputs) * self.scale
