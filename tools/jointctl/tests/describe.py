"""Loads what `jointctl eds` and `jointctl dbc` write, and compares it with a joint: describe.py EDS DBC GROUP PORT NODE ENTRIES.

Warnings are errors, whether Python's or the logging module's. ENTRIES is how many the joint's table has.
"""

import logging
import struct
import sys
import time
import warnings

warnings.simplefilter("error")
logged = []


class Collector(logging.Handler):
    def emit(self, record):
        logged.append(record.getMessage())


logging.getLogger().addHandler(Collector(level=logging.WARNING))

import canopen
import cantools
from canopen.objectdictionary import ODVariable, datatypes

eds_path, dbc_path, group, port, node_id, entries = sys.argv[1:]
port, node_id, entries = int(port), int(node_id), int(entries)

dictionary = canopen.import_od(eds_path, node_id)
database = cantools.database.load_file(dbc_path, strict=True)
assert not logged, logged

network = canopen.Network()
network.connect(interface="udp_multicast", channel=group, port=port)
node = network.add_node(node_id, dictionary)
node.sdo.RESPONSE_TIMEOUT = 2.0

# Objects of the file are the joint's, with its types and its access.
variables = []
for entry in dictionary.values():
    # Below 1000h are the data types that an RPDO may skip.
    if entry.index >= 0x1000:
        variables += [entry] if isinstance(entry, ODVariable) else list(entry.values())
assert len(variables) == entries, (len(variables), entries)

WRITE_ONLY, READ_ONLY, NO_DATA = 0x06010001, 0x06010002, 0x08000024
lengths = {datatypes.BOOLEAN: 1, datatypes.INTEGER8: 1, datatypes.UNSIGNED8: 1, datatypes.INTEGER16: 2,
           datatypes.UNSIGNED16: 2, datatypes.INTEGER32: 4, datatypes.UNSIGNED32: 4, datatypes.REAL32: 4,
           datatypes.UNSIGNED64: 8, datatypes.VISIBLE_STRING: None, datatypes.DOMAIN: None}
defaults = 0
for variable in variables:
    what = f"{variable.index:04X}h:{variable.subindex} {variable.name}"
    try:
        value = node.sdo.upload(variable.index, variable.subindex)
    except canopen.SdoAbortedError as abort:
        # The error history is as long as there were errors.
        if variable.index == 0x1003 and abort.code == NO_DATA:
            continue
        assert variable.access_type == "wo" and abort.code == WRITE_ONLY, (what, abort)
        continue
    assert variable.access_type != "wo", what
    length = lengths[variable.data_type]
    assert length is None or len(value) == length, (what, value)
    if not variable.writable and length is not None:
        try:
            node.sdo.download(variable.index, variable.subindex, value)
            raise AssertionError(f"{what} is not read-only")
        except canopen.SdoAbortedError as abort:
            assert abort.code == READ_ONLY, (what, abort)
    if variable.default is not None and length is not None:
        number = variable.decode_raw(value)
        # Bit 30 of a TPDO's COB-ID, "no remote frames", reads as the joint has it.
        if 0x1800 <= variable.index < 0x1A00 and variable.subindex == 1:
            number &= ~(1 << 30)
        assert number == variable.default, (what, number, variable.default)
        defaults += 1
print("objects", len(variables), "defaults", defaults)

# What may be mapped is what the joint lets one map, and nothing else: into TPDO 4, which is out of service meanwhile.
cob_id = 0x480 + node_id
node.sdo.download(0x1803, 1, struct.pack("<I", 1 << 31 | cob_id))
node.sdo.download(0x1A03, 0, b"\0")
mappable = 0
for variable in variables:
    length = lengths[variable.data_type]
    if variable.index < 0x2000 or length is None:
        assert not variable.pdo_mappable, variable
        continue
    mapping = struct.pack("<I", variable.index << 16 | variable.subindex << 8 | 8 * length)
    try:
        node.sdo.download(0x1A03, 1, mapping)
        taken = True
    except canopen.SdoAbortedError:
        taken = False
    transmitted = variable.pdo_mappable and variable.access_type in ("ro", "const", "rwr")
    assert taken == transmitted, (f"{variable.index:04X}h:{variable.subindex}", variable.access_type, taken)
    mappable += taken
node.nmt.state = "RESET COMMUNICATION"
time.sleep(0.5)
print("mappable", mappable)

# PDOs, as python-canopen reads them from the joint, are those of the DBC; a frame means the same to both, and to an SDO.
node.tpdo.read()
frames = {}
for number in (1, 2, 3, 4):
    message = database.get_message_by_name(f"joint{node_id}_TPDO{number}")
    mapped = node.tpdo[number]
    assert message.frame_id == mapped.cob_id and len(message.signals) == len(mapped.map), message
    for signal, variable in zip(sorted(message.signals, key=lambda signal: signal.start), mapped.map):
        assert signal.length == variable.length and signal.start == variable.offset, (signal, variable)
    network.subscribe(message.frame_id, lambda identifier, data, _: frames.__setitem__(identifier, bytes(data)))
node.nmt.state = "OPERATIONAL"
deadline = time.time() + 5
while len(frames) < 4 and time.time() < deadline:
    network.sync.transmit()
    time.sleep(0.02)
assert len(frames) == 4, frames
decoded = {}
for identifier, data in frames.items():
    decoded.update(database.decode_message(identifier, data))
voltage = struct.unpack("<H", node.sdo.upload(0x2021, 1))[0] * 0.01
assert abs(decoded["bus_voltage"] - voltage) < 0.5 and voltage > 1, (decoded, voltage)
assert decoded["acting_model"] == "nothing", decoded
assert abs(decoded["position_actual_value"]) < 10, decoded

# The impedance frame: what cantools packs is what the joint takes.
frame = database.encode_message(f"joint{node_id}_RPDO3", {
    "impedance_position": 12.5, "impedance_velocity": -65.0, "impedance_stiffness": 250.0,
    "impedance_damping": 5.0, "impedance_torque": 18.0})
network.send_message(0x400 + node_id, frame)
time.sleep(0.1)
assert node.sdo.upload(0x2011, 1) == frame, frame.hex()
assert frame[:3] == b"\xff\xff\x00" and frame[5:] == b"\xff\xff\xff", frame.hex()
print("frames", len(frames))

network.disconnect()
assert not logged, logged
