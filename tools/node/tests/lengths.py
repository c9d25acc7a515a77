"""SDO by python-canopen of every length from 1 to 2048 bytes by block, and up to 300 bytes expedited and segmented, then every thirteenth (any rest of two
segments), both ways. Run by python_canopen.rs against several virtual joints at once, each with its share of the lengths.

    python3 lengths.py GROUP PORT NODE FIRST STEP
"""

import binascii
import struct
import sys

import canopen

group, port, node_id, first, step = sys.argv[1], *(int(argument) for argument in sys.argv[2:6])
network = canopen.Network()
network.connect(interface="udp_multicast", channel=group, port=port)
node = network.add_node(node_id, canopen.objectdictionary.ObjectDictionary())
node.sdo.RESPONSE_TIMEOUT = 5


def number(index, subindex):
    return struct.unpack("<I", node.sdo.upload(index, subindex))[0]


# The staging object takes 1 to 2048 bytes, and gives them back.
pattern = bytes((i * 2_654_435_761 >> 13) & 0xFF for i in range(2048 + 2048))
lengths = range(first, 2049, step)
for length in lengths:
    for block in (False, True) if length <= 300 or length % 13 == 0 else (True,):
        data = pattern[length : 2 * length]
        if block:
            with node.sdo.open(0x2210, 0, "wb", size=length, block_transfer=True) as staging:
                staging.write(data)
        else:
            # Up to four bytes are expedited, unless the client wants segments.
            node.sdo.download(0x2210, 0, data, force_segment=length % 2 == 0)
        with node.sdo.open(0x2210, 0, "rb", block_transfer=block) as staging:
            if staging.read() != data:
                sys.exit(f"{length} bytes, by block {block}, come back as others")
        if number(0x2212, 4) != length or number(0x2212, 5) != binascii.crc32(data):
            sys.exit(f"{length} bytes, by block {block}, are not what the joint has")
network.disconnect()
print(len(lengths))
