"""Accelerations of robots as MuJoCo computes them: reads a file of cases, prints the answers, both JSON."""

import json
import sys

import mujoco


def answer(case):
    model = mujoco.MjModel.from_xml_string(case["mjcf"])
    data = mujoco.MjData(model)
    places = [model.joint(name).dofadr[0] for name in case["names"]]
    data.qpos[places] = case["q"]
    data.qvel[places] = case["v"]
    data.qfrc_applied[places] = case["torque"]
    mujoco.mj_forward(model, data)
    mass = model.body_mass.sum()
    return {"acceleration": data.qacc[places].tolist(), "mass": mass, "joints": model.njnt}


with open(sys.argv[1], encoding="utf-8") as file:
    print(json.dumps([answer(case) for case in json.load(file)]))
