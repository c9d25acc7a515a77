"""Dynamics of robots as Pinocchio computes them: reads a file of cases, prints the answers, both JSON."""

import json
import sys

import numpy
import pinocchio

# Pinocchio's parameters are m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz.
COLUMNS = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]


def answer(case):
    model = pinocchio.buildModelFromXML(case["urdf"])
    data = model.createData()
    order = [model.getJointId(name) for name in case["names"]]
    places = [model.joints[joint].idx_q for joint in order]
    columns = [10 * (joint - 1) + column for joint in order for column in COLUMNS]

    def spread(values):
        out = numpy.zeros(model.nq)
        out[places] = values
        return out

    q, v, a = (spread(case[name]) for name in "qva")
    torque = pinocchio.rnea(model, data, q, v, a)
    mass = numpy.array(pinocchio.crba(model, data, q))
    mass = numpy.triu(mass) + numpy.triu(mass, 1).T
    regressor = numpy.reshape(pinocchio.computeJointTorqueRegressor(model, data, q, v, a), (model.nv, -1))
    acceleration = pinocchio.aba(model, data, q, v, torque)
    return {
        "torque": torque[places].tolist(),
        "mass_matrix": mass[numpy.ix_(places, places)].ravel().tolist(),
        "regressor": regressor[numpy.ix_(places, columns)].ravel().tolist(),
        "acceleration": acceleration[places].tolist(),
    }


with open(sys.argv[1], encoding="utf-8") as file:
    print(json.dumps([answer(case) for case in json.load(file)]))
