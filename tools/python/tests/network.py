"""Baseline c's network: its derivatives, what it learns, and what it never sees."""

import unittest

import numpy as np

import synthetic
from baselines.__main__ import LEAST, judge
from baselines.network import Corrected, Network
from baselines.physical import Extended, Simple, rms
from baselines.samples import TableError


def cogging(samples, load):
    """What no term of b describes."""
    return 0.5 * np.sin(6 * samples.position)


class Trained(unittest.TestCase):
    def test_the_derivatives_are_those_of_the_output(self):
        network, random = Network(3, seed=4), np.random.default_rng(1)
        self.assertEqual(len(network.weights), 3 * 5 + 5 + 2 * (25 + 5) + 5 + 1)
        inputs = random.standard_normal((7, 3))
        output, jacobian = network.derivatives(inputs, network.weights)
        np.testing.assert_array_equal(output, network(inputs))
        for i in range(len(network.weights)):
            step = np.zeros(len(network.weights))
            step[i] = 1e-6
            difference = (network(inputs, network.weights + step) - network(inputs, network.weights - step)) / 2e-6
            np.testing.assert_allclose(jacobian[:, i], difference, atol=1e-8)

    def test_c_learns_what_b_cannot_describe(self):
        found = judge(synthetic.joint(cogging), most=2000)["tests"][0]["baselines"]
        self.assertGreater(found["b"]["rmse"], 4 * synthetic.NOISE)
        self.assertLess(found["c"]["rmse"], 0.3 * found["b"]["rmse"])

    def test_the_network_of_the_seed_with_the_lowest_validation_error_is_used(self):
        samples = synthetic.joint(cogging)
        known = samples.where(samples.of_part("train", "validation"))
        train, validation = (samples.where(samples.of_part(part)) for part in ("train", "validation"))
        simple = Simple.fit(known)
        found = Corrected.fit(train, validation, simple, Extended.fit(known, simple), seeds=3, most=12_000, steps=10)
        self.assertGreater(max(found.validation), 1.02 * min(found.validation))
        self.assertAlmostEqual(rms(validation.effort - found.predict(validation)), min(found.validation), places=9)

        before = found.predict(samples)
        samples.effort = samples.effort + 1
        np.testing.assert_array_equal(found.predict(samples), before, "the measured effort is an input")

    def test_nothing_is_learned_from_test_samples(self):
        first, second = synthetic.joint(cogging), synthetic.joint(cogging)
        second.effort = np.where(second.of_part("test"), 100.0, second.effort)
        second.predictions = {"zero": np.zeros(len(second.effort))}
        first, second = (judge(samples, most=500, steps=10) for samples in (first, second))
        for model in ("a", "b", "c"):
            self.assertEqual(first[model], second[model])
        self.assertAlmostEqual(second["tests"][0]["exported"]["zero"]["rmse"], 100)
        self.assertAlmostEqual(second["tests"][0]["exported"]["zero"]["percent_of_rms"], 100)

    def test_too_few_samples_are_refused_by_part(self):
        for part in ("train", "validation", "test"):
            for count, refused in ((LEAST - 1, True), (LEAST, False)):
                samples = synthetic.joint(count=1200)
                samples.part = np.where((samples.part == part) & (np.cumsum(samples.part == part) > count), "unused",
                                        samples.part)
                with self.subTest(part, count=count):
                    if refused:
                        with self.assertRaisesRegex(TableError, f"{count} samples.*{LEAST}"):
                            judge(samples, seeds=1, steps=1)
                    else:
                        judge(samples, seeds=1, steps=1)


if __name__ == "__main__":
    unittest.main()
