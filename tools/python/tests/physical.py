"""Baselines a and b find the parameters of joints that have exactly these."""

import unittest

import numpy as np

import synthetic
from baselines.physical import Extended, Simple, rms


class Physical(unittest.TestCase):
    def test_a_recovers_a_joint_of_inertia_gravity_viscous_and_coulomb_friction(self):
        found = Simple.fit(synthetic.joint())
        for name, true in (("inertia", synthetic.INERTIA), ("gravity_sine", synthetic.GRAVITY),
                           ("viscous", synthetic.VISCOUS), ("coulomb", synthetic.COULOMB), ("offset", synthetic.OFFSET)):
            self.assertLess(abs(found.coefficients[name] - true), 0.05 * abs(true), name)
        self.assertLess(found.residual, 1.05 * synthetic.NOISE)

    def test_each_term_of_b_is_recovered_where_a_is_blind_to_it(self):
        sign = lambda s: np.tanh(s.velocity / (0.02 * np.abs(s.velocity).max()))
        warmer = np.repeat([-1.0, 1.0, 0.5, -0.5], 1500)
        terms = {
            "viscous_asymmetry": lambda s, load: 0.3 * np.abs(s.velocity),
            "coulomb_asymmetry": lambda s, load: 0.3 * np.abs(sign(s)),
            "stribeck": lambda s, load: 0.8 * sign(s) * np.exp(-((s.velocity / 0.15) ** 2)),
            "quadratic": lambda s, load: 0.3 * s.velocity * np.abs(s.velocity),
            "load": lambda s, load: 0.3 * sign(s) * np.abs(load),
            "stribeck_load": lambda s, load: 0.6 * sign(s) * np.abs(load) * np.exp(-((s.velocity / 0.15) ** 2)),
            "viscous_temperature": lambda s, load: -0.2 * s.velocity * warmer,
            "coulomb_temperature": lambda s, load: -0.3 * sign(s) * warmer,
            "offset_temperature": lambda s, load: 0.1 * warmer,
        }
        for name, term in terms.items():
            true = {"viscous_asymmetry": 0.3, "coulomb_asymmetry": 0.3, "stribeck": 0.8, "quadratic": 0.3, "load": 0.3,
                    "stribeck_load": 0.6, "viscous_temperature": -0.2, "coulomb_temperature": -0.3,
                    "offset_temperature": 0.1}[name]
            samples = synthetic.joint(term, temperature=30 + 10 * warmer)
            simple = Simple.fit(samples)
            found = Extended.fit(samples, simple)
            with self.subTest(name):
                self.assertLess(found.residual, 1.1 * synthetic.NOISE)
                self.assertGreater(simple.residual, 1.3 * found.residual)
                self.assertLess(abs(found.coefficients[name] - true), 0.3 * abs(true))

    def test_the_load_torque_is_the_rigid_part_and_knows_nothing_of_the_effort(self):
        samples = synthetic.joint()
        simple = Simple.fit(samples)
        before = simple.load(samples)
        truth = synthetic.INERTIA * samples.rigid["inertia"] + synthetic.GRAVITY * samples.rigid["gravity_sine"]
        self.assertLess(rms(before - truth), 0.02 * rms(truth))
        samples.effort = samples.effort + 5
        np.testing.assert_array_equal(simple.load(samples), before)

    def test_a_joint_without_rigid_body_has_no_load(self):
        samples = synthetic.joint()
        samples.rigid = {}
        simple = Simple.fit(samples)
        self.assertEqual(rms(simple.load(samples)), 0)
        extended = Extended.fit(samples, simple)
        self.assertEqual(extended.coefficients["load"], 0)
        self.assertTrue(np.all(np.isfinite(extended.predict(samples))))


if __name__ == "__main__":
    unittest.main()
