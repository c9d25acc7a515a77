// SDO by node-canopen of every length from 1 to 2048 bytes by block, and up to 300 bytes expedited and segmented, then every thirteenth (any rest of
// two segments), both ways. Run by node_canopen.rs against several virtual joints at once, each with its share of the lengths.
//
//     node lengths.js MODULES PORT NODE FIRST STEP

const [, , modules, port, id, first, step] = process.argv;
const { Device, DataType } = require(require.resolve('canopen', { paths: [modules] }));
const { Slcan } = require('./slcan.js');
const zlib = require('zlib');

const node = Number(id);
const device = new Device({ id: 0x7e });
const channel = new Slcan(Number(port), (message) => device.receive(message));
device.addListener('message', (message) => channel.send(message));
device.eds.addSdoClientParameter(node, 0x600 + node, 0x580 + node);

const at = (index, subIndex) => ({ deviceId: node, index, subIndex, timeout: 5000, blockInterval: 0 });
const number = (subIndex) => device.sdo.upload({ ...at(0x2212, subIndex), dataType: DataType.UNSIGNED32 });

/** The staging object takes 1 to 2048 bytes, and gives them back. */
async function main() {
    device.start();
    const pattern = Buffer.from([...Array(4096).keys()].map((i) => Number(BigInt(i) * 2654435761n >> 13n & 255n)));
    let count = 0;
    for (let length = Number(first); length <= 2048; length += Number(step)) {
        for (const blockTransfer of length <= 300 || length % 13 === 0 ? [false, true] : [true]) {
            const data = pattern.subarray(length, 2 * length);
            await device.sdo.download({ ...at(0x2210, 0), data, blockTransfer });
            const same = data.equals(await device.sdo.upload({ ...at(0x2210, 0), blockTransfer }));
            const counted = await number(4) === length;
            const sum = zlib.crc32 === undefined || await number(5) === zlib.crc32(data);
            if (!same || !counted || !sum)
                throw new Error(`${length} bytes, by block ${blockTransfer}, do not arrive`);
        }
        ++count;
    }
    console.log(count);
    process.exit(0);
}

main().catch((error) => {
    console.log('FAILED', error);
    process.exit(1);
});
