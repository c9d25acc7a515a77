"""Drives a virtual joint with python-canopen: enables it, turns it, uploads a friction image.

    pip install canopen python-can msgpack
    cargo run --release -p jointctl -- sim --bus udp:239.74.163.2:43113 --node 5
    python3 tools/node/examples/drive.py 239.74.163.2 43113 5 [friction.img]
"""

import struct
import sys
import time

import canopen

VELOCITY_MODE = 9
group, port, node_id = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])

network = canopen.Network()
network.connect(interface="udp_multicast", channel=group, port=port)
node = network.add_node(node_id, canopen.objectdictionary.ObjectDictionary())
emergencies = []
node.emcy.add_callback(lambda error: emergencies.append(error.code))


def number(kind, index, subindex=0):
    return struct.unpack("<" + kind, node.sdo.upload(index, subindex))[0]


def command(controlword, velocity, seconds):
    """RPDO 2 every 10 ms: the joint brakes where its commands stop coming."""
    for _ in range(int(seconds / 0.01)):
        network.send_message(0x300 + node_id, struct.pack("<Hbi", controlword, VELOCITY_MODE, velocity))
        time.sleep(0.01)


print("name", node.sdo.upload(0x1008, 0).decode())
node.nmt.state = "OPERATIONAL"
for controlword in (0x06, 0x07, 0x0F):
    command(controlword, 0, 0.05)
command(0x0F, 500, 1.0)
print(f"status {number('H', 0x6041):#06x} velocity {number('i', 0x606C)} mrad/s")

# Without commands the joint brakes and reports an EMCY.
time.sleep(1.0)
print(f"status {number('H', 0x6041):#06x} emergencies {[hex(code) for code in emergencies]}")
command(0x80, 0, 0.05)
command(0x00, 0, 0.05)

if len(sys.argv) > 4:
    image = open(sys.argv[4], "rb").read()
    with node.sdo.open(0x2210, 0, "wb", size=len(image), block_transfer=True) as staging:
        staging.write(image)
    node.sdo.download(0x2212, 1, bytes([1]))  # verify
    node.sdo.download(0x2212, 1, bytes([3]))  # commit
    print("image version", number("I", 0x2213, 1), "state", number("B", 0x2212, 2))
    with node.sdo.open(0x2211, 0, "rb", block_transfer=True) as active:
        print("read back", active.read() == image)
network.disconnect()
