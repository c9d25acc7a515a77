"""What python-canopen must be able to do with a joint. Run by python_canopen.rs against a virtual joint; every check says what it is about.

    python3 conformance.py GROUP PORT NODE FIRST.img SECOND.img
"""

import struct
import sys
import time

import canopen
from canopen.objectdictionary import ODRecord, ODVariable, ObjectDictionary, datatypes

TORQUE, VELOCITY, POSITION, IMPEDANCE = 10, 9, 8, -1
group, port, node_id = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
first, second = (open(path, "rb").read() for path in sys.argv[4:6])


def check(condition, text):
    if not condition:
        sys.exit(f"FAILED {text}")
    print("ok", text, flush=True)


def dictionary():
    """The objects that PDOs carry, and the PDOs' own."""
    u8, u16, u32, i8, i16, i32 = (
        getattr(datatypes, name)
        for name in ("UNSIGNED8", "UNSIGNED16", "UNSIGNED32", "INTEGER8", "INTEGER16", "INTEGER32")
    )
    od = ObjectDictionary()

    def variable(index, subindex, name, kind):
        found = ODVariable(name, index, subindex)
        found.data_type = kind
        return found

    def record(index, members):
        found = ODRecord(f"record {index:04x}", index)
        for subindex, name, kind in [(0, "highest sub-index", u8), *members]:
            found.add_member(variable(index, subindex, name, kind))
        od.add_object(found)

    for index, name, kind in [
        (0x6040, "controlword", u16),
        (0x6041, "statusword", u16),
        (0x6060, "mode", i8),
        (0x6064, "position", i32),
        (0x606C, "velocity", i32),
        (0x6071, "target torque", i16),
        (0x6077, "torque", i16),
        (0x607A, "target position", i32),
        (0x60FF, "target velocity", i32),
    ]:
        od.add_object(variable(index, 0, name, kind))
    record(0x2011, [(1, "impedance frame", datatypes.UNSIGNED64)])
    record(0x2020, [(1, "compensation torque", i16), (2, "residual torque", i16)])
    for number in range(4):
        timers = [(1, "cob id", u32), (2, "type", u8), (5, "event timer", u16)]
        record(0x1400 + number, timers)
        record(0x1800 + number, [*timers, (3, "inhibit time", u16)])
        for base in (0x1600, 0x1A00):
            record(base + number, [(entry, f"entry {entry}", u32) for entry in range(1, 9)])
    return od


network = canopen.Network()
network.connect(interface="udp_multicast", channel=group, port=port)
node = network.add_node(node_id, dictionary())
node.sdo.RESPONSE_TIMEOUT = 2.0
emergencies, heartbeats = [], []
node.emcy.add_callback(lambda error: emergencies.append(error.code))
network.subscribe(0x700 + node_id, lambda cob_id, data, timestamp: heartbeats.append(data[0]))


def number(kind, index, subindex=0):
    return struct.unpack("<" + kind, node.sdo.upload(index, subindex))[0]


def write(kind, value, index, subindex=0):
    node.sdo.download(index, subindex, struct.pack("<" + kind, value))


def until(condition, seconds=10.0, each=lambda: time.sleep(0.01)):
    """Waits for a condition, doing something meanwhile; whether it came."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        each()
    return True


def status():
    return number("H", 0x6041) & 0x6F


def reset():
    heartbeats.clear()
    node.nmt.state = "RESET"
    check(until(lambda: 0 in heartbeats), "a reset is followed by a boot-up message")


# PDO traffic both ways: the mapping is read from the joint.
for pdo in (node.tpdo[1], node.tpdo[2], node.rpdo[1], node.rpdo[2], node.rpdo[3]):
    pdo.read()
check(
    [variable.name for variable in node.rpdo[1]] == ["controlword", "target torque", "target position"]
    and [variable.name.split(".")[-1] for variable in node.tpdo[2]]
    == ["velocity", "compensation torque", "residual torque"],
    "the PDOs' mapping is what the joint says",
)
seen = {}
for pdo in (node.tpdo[1], node.tpdo[2]):
    pdo.add_callback(lambda message: seen.update({variable.name: variable.raw for variable in message}))


def cycle():
    network.sync.transmit()
    time.sleep(0.01)


def command(controlword, torque=0, position=None):
    """RPDO 1 and SYNC."""
    pdo = node.rpdo[1]
    pdo["controlword"].raw = controlword
    pdo["target torque"].raw = torque
    pdo["target position"].raw = seen.get("position", 0) if position is None else position
    pdo.transmit()
    cycle()


def turn(velocity, controlword=0x0F):
    """RPDO 2 and SYNC."""
    pdo = node.rpdo[2]
    pdo["controlword"].raw = controlword
    pdo["mode"].raw = VELOCITY
    pdo["target velocity"].raw = velocity
    pdo.transmit()
    cycle()


def enable(mode):
    """From "switch on disabled" to "operation enabled"."""
    until(lambda: seen.get("statusword", 0) & 0x6F == 0x40, each=lambda: command(0x00))
    write("b", mode, 0x6060)
    for controlword, state in ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
        reached = until(lambda: seen["statusword"] & 0x6F == state, 10.0, lambda: command(controlword))
        check(reached, f"controlword {controlword:#04x} leads to {state:#04x} in mode {mode}")
    check(number("b", 0x6061) == mode, f"mode {mode} is shown")


# A machine that runs many tests lets this program wait for longer than a joint without commands does before it brakes.
default = number("f", 0x2103, 11)
write("f", 1.0, 0x2103, 11)
write("B", 1, 0x2100, 1)
node.nmt.state = "OPERATIONAL"
check(until(lambda: "position" in seen and "velocity" in seen, each=cycle), "SYNC is answered by TPDO 1 and TPDO 2")
check(abs(seen["position"] - number("i", 0x6064)) < 2000, "TPDO and SDO tell the same position")

enable(TORQUE)
check(until(lambda: seen["velocity"] > 100, 10.0, lambda: command(0x0F, 60)), "a positive torque accelerates")
check(until(lambda: seen["velocity"] < -100, 10.0, lambda: command(0x0F, -60)), "a negative one the other way")

enable(VELOCITY)
check(until(lambda: 480 < seen["velocity"] < 520, 10.0, lambda: turn(500)), "a velocity is followed")
check(until(lambda: abs(seen["velocity"]) < 20, 10.0, lambda: turn(0)), "and so is zero")

enable(POSITION)
target = seen["position"] + 200_000
reached = until(lambda: abs(seen["position"] - target) < 10_000, 10.0, lambda: command(0x0F, 0, target))
check(reached, "a position is reached")

until(lambda: seen["statusword"] & 0x6F == 0x40, each=lambda: command(0x00))
ranges = [12.5, 65.0, 500.0, 50.0, 18.0]
write("f", ranges[3], 0x2012, 4)
enable(IMPEDANCE)
target = seen["position"] * 1e-6 - 0.2


def impedance():
    """RPDO 3: position 16 bits, velocity, stiffness, damping, torque 12 bits each, most significant first."""
    wanted = (target, 0.0, 300.0, 20.0, 0.0)
    bits = 0
    for value, most, width, signed in zip(wanted, ranges, (16, 12, 12, 12, 12), (1, 1, 0, 0, 1)):
        steps = 2**width - 1
        bits = bits << width | round(steps * ((value / most + 1) / 2 if signed else value / most))
    node.rpdo[3][0].raw = int.from_bytes(bits.to_bytes(8, "big"), "little")
    node.rpdo[3].transmit()
    cycle()


reached = until(lambda: abs(seen["position"] * 1e-6 - target) < 0.03, 10.0, impedance)
check(reached, "an impedance frame pulls the joint to its position")

# A fault, by silence.
emergencies.clear()
check(until(lambda: 0x8100 in emergencies), "without commands the joint reports EMCY 8100h")
check(number("B", 0x1001) & 0x10 and number("H", 0x603F) == 0x8100, "error register and error code say the same")
check(number("I", 0x1003, 1) & 0xFFFF == 0x8100, "and the history of errors")
check(len(node.sdo.upload(0x2300, 0)) == 64 * 36, "the steps before the fault can be read")
until(lambda: seen["statusword"] & 0x6F == 0x40, 10.0, lambda: command(0x80))
check(until(lambda: 0 in emergencies, 10.0, lambda: command(0x00)), "a reset of the fault is EMCY 0000h")

# PDOs that python-canopen maps: a TPDO that comes by itself, an RPDO that acts at once.
heard = []
tpdo, rpdo = node.tpdo[4], node.rpdo[4]
tpdo.read()
rpdo.read()
tpdo.clear()
tpdo.add_variable("position")
tpdo.trans_type, tpdo.inhibit_time, tpdo.event_timer, tpdo.enabled = 255, 100, 50, True
tpdo.save()
check(number("H", 0x1803, 3) == 100 and number("H", 0x1803, 5) == 50, "inhibit time and event timer are the joint's")
tpdo.add_callback(lambda message: heard.append(message[0].raw))
check(until(lambda: len(heard) > 3), "a TPDO with an event timer comes without a SYNC")
rpdo.clear()
rpdo.add_variable("target velocity")
rpdo.trans_type, rpdo.enabled = 255, True
rpdo.save()
rpdo[0].raw = 321
rpdo.transmit()
check(until(lambda: number("i", 0x60FF) == 321), "an RPDO that python-canopen has mapped is taken")
heartbeats.clear()
node.nmt.state = "RESET COMMUNICATION"
check(until(lambda: 0 in heartbeats), "a reset of communication is followed by a boot-up message")
node.nmt.state = "OPERATIONAL"

# Heartbeats both ways.
write("H", 50, 0x1017)
time.sleep(0.1)
heartbeats.clear()
began = time.monotonic()
time.sleep(1.0)
due = (time.monotonic() - began) / 0.05
check(0.5 * due <= len(heartbeats) <= 1.2 * due and set(heartbeats) == {5}, "a heartbeat every 50 ms says OPERATIONAL")
write("I", 127 << 16 | 1000, 0x1016, 1)
for _ in range(10):
    network.send_message(0x77F, [5])
    time.sleep(0.05)
check(heartbeats[-1] == 5 and 0x8130 not in emergencies, "a master that is heard is not missed")
check(until(lambda: 0x8130 in emergencies, 10.0), "a master that falls silent is: EMCY 8130h")
check(until(lambda: heartbeats[-1] == 0x7F, 10.0), "and the joint leaves OPERATIONAL")
write("I", 0, 0x1016, 1)

# Store and restore.
write("f", 0.25, 0x2103, 11)
check(number("B", 0x2100, 7) == 1, "a setting is staged")
write("B", 1, 0x2100, 1)
check(number("B", 0x2100, 7) == 0, "and taken")
write("I", int.from_bytes(b"save", "little"), 0x1010, 1)
write("f", 0.5, 0x2103, 11)
write("B", 1, 0x2100, 1)
write("H", 0, 0x1017)
reset()
check(number("f", 0x2103, 11) == 0.25 and number("H", 0x1017) == 50, "what is stored is there after a reset")
write("I", int.from_bytes(b"load", "little"), 0x1011, 1)
reset()
check(number("f", 0x2103, 11) == default and number("H", 0x1017) == 0, "defaults are restored")

# Images: upload to commit, and back.
def image(command_number):
    write("B", command_number, 0x2212, 1)


for version, content in ((1, first), (2, second)):
    with node.sdo.open(0x2210, 0, "wb", size=len(content), block_transfer=True) as staging:
        staging.write(content)
    image(1)
    check(number("B", 0x2212, 2) == 2, f"image {version} is verified")
    image(3)
    check(number("I", 0x2213, 1) == version, f"image {version} is active")
    with node.sdo.open(0x2211, 0, "rb", block_transfer=True) as active:
        check(active.read() == content, f"image {version} is read back")
emergencies.clear()
node.sdo.download(0x2210, 0, second[:-1] + bytes([second[-1] ^ 1]))
try:
    image(1)
    check(False, "a damaged image is refused")
except canopen.SdoAbortedError as refused:
    check(refused.code == 0x08000020 and number("H", 0x2212, 3) != 0, "a damaged image is refused, with a reason")
check(until(lambda: 0x6320 in emergencies, 10.0), "and reported by EMCY 6320h")
image(5)
image(4)
check(number("I", 0x2213, 1) == 1 and number("I", 0x2214, 1) == 2, "a roll back brings the first image back")
network.disconnect()
print("done")
