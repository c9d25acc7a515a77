"""Turns a joint to and fro, and gives it another friction image meanwhile. Run by emulated_upload.rs against a board's program on an emulated board.

    python3 upload_in_motion.py GROUP PORT NODE IMAGE
"""

import math
import struct
import sys
import threading
import time

import canopen

VELOCITY_MODE = 9
group, port, node_id, path = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]

network = canopen.Network()
network.connect(interface="udp_multicast", channel=group, port=port)
node = network.add_node(node_id, canopen.objectdictionary.ObjectDictionary())
# The emulated board may be slower than the clock on the wall.
node.sdo.RESPONSE_TIMEOUT = 60
image = open(path, "rb").read()
wanted = [0x06, 0.0]
over = threading.Event()


def number(kind, index, subindex=0):
    return struct.unpack("<" + kind, node.sdo.upload(index, subindex))[0]


def state():
    return number("H", 0x6041) & 0x6F


def commands():
    """RPDO 2 every 5 ms, with a velocity that swings."""
    start = time.monotonic()
    while not over.is_set():
        controlword, amplitude = wanted
        velocity = int(1000 * amplitude * math.sin(4 * (time.monotonic() - start)))
        network.send_message(0x300 + node_id, struct.pack("<Hbi", controlword, VELOCITY_MODE, velocity))
        time.sleep(0.005)


def until(reached, what):
    for _ in range(1200):
        if reached():
            return
        time.sleep(0.05)
    sys.exit(f"never {what}: state {state():#04x}, image {number('B', 0x2212, 2)}, result {number('H', 0x2212, 3)}")


def order(command):
    node.sdo.download(0x2212, 1, bytes([command]))


# The node has something to send all the time, also amid the segments of a block.
node.sdo.download(0x1017, 0, struct.pack("<H", 5))
node.nmt.state = "OPERATIONAL"
thread = threading.Thread(target=commands)
thread.start()
try:
    for controlword, reached in ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
        wanted[0] = controlword
        until(lambda: state() == reached, f"in state {reached:#04x}")
    wanted[1] = 1.5
    print("version", number("I", 0x2213, 1), flush=True)
    time.sleep(1.0)
    print("moving", flush=True)
    time.sleep(4.0)
    print("uploading", flush=True)
    with node.sdo.open(0x2210, 0, "wb", size=len(image), block_transfer=True) as staging:
        staging.write(image)
    order(1)
    until(lambda: number("B", 0x2212, 2) == 2, "verified")
    order(3)
    until(lambda: number("I", 0x2213, 1) == 2, "active")
    time.sleep(1.0)
    print("uploaded", flush=True)
    assert state() == 0x27, f"state {state():#04x}"
    with node.sdo.open(0x2211, 0, "rb", block_transfer=True) as active:
        assert active.read() == image, "another image is read back"
    print("version", number("I", 0x2213, 1), flush=True)
finally:
    over.set()
    thread.join()
    network.disconnect()
