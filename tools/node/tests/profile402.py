"""python-canopen's own profile for drives enables and moves a joint by the PDOs that it has at first: profile402.py GROUP PORT NODE."""

import sys
import time

import canopen
from canopen.objectdictionary import ODRecord, ODVariable, ObjectDictionary, datatypes
from canopen.profiles.p402 import BaseNode402

group, port, node_id = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])


def check(condition, text):
    if not condition:
        sys.exit(f"FAILED {text}")
    print("ok", text, flush=True)


def dictionary():
    """What the PDOs carry, and the PDOs' own objects."""
    od = ObjectDictionary()

    def variable(index, subindex, name, kind):
        found = ODVariable(name, index, subindex)
        found.data_type = kind
        return found

    for index, name, kind in [
        (0x6040, "controlword", datatypes.UNSIGNED16),
        (0x6041, "statusword", datatypes.UNSIGNED16),
        (0x6060, "mode", datatypes.INTEGER8),
        (0x6061, "mode display", datatypes.INTEGER8),
        (0x6064, "position", datatypes.INTEGER32),
        (0x606C, "velocity", datatypes.INTEGER32),
        (0x6071, "target torque", datatypes.INTEGER16),
        (0x6077, "torque", datatypes.INTEGER16),
        (0x607A, "target position", datatypes.INTEGER32),
        (0x607C, "home offset", datatypes.INTEGER32),
        (0x6081, "profile velocity", datatypes.UNSIGNED32),
        (0x6098, "homing method", datatypes.INTEGER8),
        (0x60FF, "target velocity", datatypes.INTEGER32),
        (0x6502, "supported drive modes", datatypes.UNSIGNED32),
    ]:
        od.add_object(variable(index, 0, name, kind))

    def record(index, members):
        found = ODRecord(f"record {index:04x}", index)
        for subindex, kind in [(0, datatypes.UNSIGNED8), *members]:
            found.add_member(variable(index, subindex, f"entry {subindex}", kind))
        od.add_object(found)

    for index, entries, kind in [
        (0x2011, 1, datatypes.UNSIGNED64),
        (0x2020, 2, datatypes.INTEGER16),
        (0x2021, 4, datatypes.INTEGER16),
        (0x2030, 1, datatypes.INTEGER32),
    ]:
        record(index, [(entry, kind) for entry in range(1, entries + 1)])
    record(0x2200, [(2, datatypes.UNSIGNED8), (6, datatypes.UNSIGNED16)])
    record(0x2212, [(2, datatypes.UNSIGNED8)])
    record(0x2213, [(1, datatypes.UNSIGNED32)])
    od.add_object(variable(0x0007, 0, "dummy", datatypes.UNSIGNED32))
    parameters = {1: datatypes.UNSIGNED32, 2: datatypes.UNSIGNED8, 3: datatypes.UNSIGNED16, 5: datatypes.UNSIGNED16}
    for number in range(4):
        for base in (0x1400, 0x1800):
            record(base + number, parameters.items())
        for base in (0x1600, 0x1A00):
            record(base + number, [(entry, datatypes.UNSIGNED32) for entry in range(1, 9)])
    return od


network = canopen.Network()
network.connect(interface="udp_multicast", channel=group, port=port)
node = BaseNode402(node_id, dictionary())
network.add_node(node)
node.sdo.RESPONSE_TIMEOUT = 2.0
# A busy machine takes longer than python-canopen has patience for by itself.
node.TIMEOUT_CHECK_TPDO = node.TIMEOUT_SWITCH_OP_MODE = 5.0
node.TIMEOUT_SWITCH_STATE_FINAL = node.TIMEOUT_SWITCH_STATE_SINGLE = 10.0
emergencies = []
node.emcy.add_callback(lambda error: emergencies.append(error.code))


def until(condition, text):
    end = time.monotonic() + 20
    while not condition():
        if time.monotonic() > end:
            sys.exit(f"FAILED {text}")
        time.sleep(0.01)
    print("ok", text, flush=True)


node.nmt.state = "PRE-OPERATIONAL"
node.setup_402_state_machine()
# This bus hands a sender its own frames, which python-canopen would take for RPDOs that somebody sends periodically.
for pdo in (pdo for pdo in node.rpdo.values() if pdo.enabled):
    network.unsubscribe(pdo.cob_id)
node.nmt.state = "OPERATIONAL"
network.sync.start(0.01)
check(0x6040 in node.rpdo_pointers and 0x6041 in node.tpdo_pointers, "controlword and statusword are in PDOs")
begun = node.sdo[0x6064].raw
node.state = "OPERATION ENABLED"
check(node.state == "OPERATION ENABLED", "the profile enables the joint, a frame a transition and zeros beside it")
# Nobody repeats anything for longer than the command deadline.
time.sleep(1.0)
node.check_statusword()
check(node.state == "OPERATION ENABLED" and not emergencies, "it stays enabled without a target")
check(abs(node.sdo[0x6064].raw - begun) < 1000, "and where it is")
node.state = "SWITCH ON DISABLED"

for mode in ("CYCLIC SYNCHRONOUS POSITION", "CYCLIC SYNCHRONOUS VELOCITY", "CYCLIC SYNCHRONOUS TORQUE"):
    # The PDO with the mode has a controlword of its own, of zero.
    node.op_mode = mode
    check(node.op_mode == mode, f"{mode} is shown")
    node.state = "OPERATION ENABLED"
    begun = node.sdo[0x6064].raw
    if mode == "CYCLIC SYNCHRONOUS POSITION":
        node.rpdo[1]["target position"].raw = begun + 100_000
        node.rpdo[1].start(0.01)
        until(lambda: abs(node.sdo[0x6064].raw - begun - 100_000) < 20_000, f"{mode} moves the joint")
        node.rpdo[1].stop()
        node.rpdo[1].period = None
    elif mode == "CYCLIC SYNCHRONOUS VELOCITY":
        node.rpdo[2]["controlword"].raw = 0x0F
        node.rpdo[2]["target velocity"].raw = 300
        node.rpdo[2].start(0.01)
        until(lambda: node.sdo[0x606C].raw > 200, f"{mode} turns the joint")
        node.rpdo[2].stop()
        node.rpdo[2].period = None
        node.rpdo[2]["controlword"].raw = 0
        node.rpdo[2]["target velocity"].raw = 0
    else:
        node.rpdo[1]["target torque"].raw = 60
        node.rpdo[1].start(0.01)
        until(lambda: node.sdo[0x606C].raw > 50, f"{mode} accelerates the joint")
        node.rpdo[1].stop()
        node.rpdo[1].period = None
        node.rpdo[1]["target torque"].raw = 0
    node.state = "SWITCH ON DISABLED"

node.sdo[0x6098].raw = 37
node.sdo[0x607C].raw = 200_000
check(node.homing(timeout=20), "the profile homes the joint where it is")
check(abs(node.sdo[0x6064].raw - 200_000) < 20_000, "which has the home offset from then on")
check(node.is_homed(), "and is homed")
node.state = "SWITCH ON DISABLED"

# A set-point, given once: nothing is sent while the joint moves there.
node.op_mode = "PROFILED POSITION"
node.state = "OPERATION ENABLED"
node.sdo[0x6081].raw = 500
begun = node.sdo[0x6064].raw
for target in (begun + 300_000, begun):
    node.rpdo[1]["target position"].raw = target
    node.controlword = 0x1F
    until(lambda: node.statusword & 0x1000, "a set-point is taken")
    node.controlword = 0x0F
    until(lambda: not node.statusword & 0x1000, "the next one may come")
    until(lambda: node.statusword & 0x400, "its target is reached")
    check(abs(node.sdo[0x6064].raw - target) < 20_000, "the joint is there")
node.state = "SWITCH ON DISABLED"

node.op_mode = "PROFILED VELOCITY"
node.state = "OPERATION ENABLED"
node.rpdo[2]["controlword"].raw = 0x0F
for velocity in (400, 0):
    node.rpdo[2]["target velocity"].raw = velocity
    node.rpdo[2].start(0.01)
    until(lambda: node.statusword & 0x400 and abs(node.sdo[0x606C].raw - velocity) < 100, f"{velocity} mrad/s is reached")
    if velocity == 0:
        # Below 606Fh for the time of 6070h: later than the target is reached. Commands go on until then.
        until(lambda: node.statusword & 0x1000, "the joint stands")
    node.rpdo[2].stop()
    node.rpdo[2].period = None
check(not emergencies, f"nothing was reported: {emergencies}")
node.state = "SWITCH ON DISABLED"
network.sync.stop()
network.disconnect()
print("done")
