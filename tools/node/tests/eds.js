// What node-canopen's own parser makes of the EDS file that `jointctl eds` writes, held against a virtual joint, which is then driven in profile
// velocity (mode 3) by the file alone. Run by node_canopen.rs, over slcan by TCP; every check says what it is about.
//
//     node eds.js MODULES PORT NODE joint.eds ENTRIES

const [, , modules, port, id, path, entries] = process.argv;
const { Device, DataType, Eds, ObjectType } = require(require.resolve('canopen', { paths: [modules] }));
const { Slcan } = require('./slcan.js');

const node = Number(id);
const [PROFILE_VELOCITY, WRITE_ONLY, NO_DATA] = [3, 0x06010001, 0x08000024];
const LENGTHS = {
    [DataType.BOOLEAN]: 1, [DataType.INTEGER8]: 1, [DataType.UNSIGNED8]: 1, [DataType.INTEGER16]: 2, [DataType.UNSIGNED16]: 2,
    [DataType.INTEGER32]: 4, [DataType.UNSIGNED32]: 4, [DataType.REAL32]: 4, [DataType.UNSIGNED64]: 8,
};

function check(condition, text) {
    if (!condition) {
        console.log('FAILED', text);
        process.exit(1);
    }
}

const joint = Eds.fromFile(path);
/** Every value of the file: [index, sub-index, entry]. */
const variables = [...joint.values()].filter((entry) => entry.index >= 0x1000).flatMap((entry) => {
    if (entry.objectType !== ObjectType.RECORD)
        return [[entry.index, 0, entry]];
    const all = Array.from({ length: 256 }, (_, subIndex) => [entry.index, subIndex, entry[subIndex]]);
    return all.filter(([, , member]) => member !== undefined);
});

const device = new Device({ id: 0x7e });
const channel = new Slcan(Number(port), (message) => device.receive(message));
device.addListener('message', (message) => channel.send(message));
device.eds.addSdoClientParameter(node, 0x600 + node, 0x580 + node);
device.eds.setSyncCobId(0x080);
device.eds.setSyncGenerationEnable(true);

/** What a PDO of the joint carries by the file, as objects of this device's own dictionary. */
function mapped(index) {
    const mapping = joint.getEntry(index);
    return Array.from({ length: Number(mapping[0].defaultValue) }, (_, place) => {
        const entry = joint.getEntry(Number(mapping[place + 1].defaultValue) >>> 16);
        const { parameterName, dataType } = entry;
        return device.eds.getEntry(entry.index) ?? device.eds.addEntry(entry.index, { parameterName, dataType });
    });
}

device.eds.addTransmitPdo({ cobId: 0x300 + node, transmissionType: 240, dataObjects: mapped(0x1601) });
device.eds.addReceivePdo({ cobId: 0x180 + node, dataObjects: mapped(0x1a00) });
device.start();

const upload = (index, subIndex) => device.sdo.upload({ deviceId: node, index, subIndex, timeout: 2000 });
const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** Every object of the file is the joint's, of its type and with its default. */
async function compare() {
    check(variables.length === Number(entries), `${variables.length} values instead of ${entries}`);
    let defaults = 0;
    for (const [index, subIndex, entry] of variables) {
        const what = `${index.toString(16)}h:${subIndex} ${entry.parameterName}`;
        let value;
        try {
            value = await upload(index, subIndex);
        } catch (error) {
            // The error history is as long as there were errors.
            const expected = index === 0x1003 ? error.code === NO_DATA : entry.accessType === 'wo' && error.code === WRITE_ONLY;
            check(expected, `${what}: ${error}`);
            continue;
        }
        check(entry.accessType !== 'wo', `${what} can be read`);
        const length = LENGTHS[entry.dataType];
        check(length === undefined || value.length === length, `${what} has ${value.length} bytes`);
        const number = Number(entry.defaultValue);
        if (length !== undefined && length <= 4 && entry.defaultValue !== undefined && !Number.isNaN(number)) {
            const found = value.readUIntLE(0, length);
            check(found === (number >>> 0) % 2 ** (8 * length), `${what} is ${found}, its default ${entry.defaultValue}`);
            ++defaults;
        }
    }
    console.log('values', variables.length, 'defaults', defaults);
}

async function drive() {
    // The TPDO with the velocity has objects with sub-indices beside it.
    const velocity = async () => (await upload(joint.findEntry('velocity actual value')[0].index, 0)).readInt32LE();
    const object = (name) => device.eds.getEntry(joint.findEntry(name)[0].index);
    const status = (mask) => object('statusword').value & mask;
    const until = async (condition, word, speed, text) => {
        const end = Date.now() + 10000;
        object('controlword').value = word;
        object('modes of operation').value = PROFILE_VELOCITY;
        object('target velocity').value = speed;
        for (;;) {
            device.pdo.write(0x300 + node);
            device.sync.write();
            await sleep(10);
            if (await condition())
                break;
            check(Date.now() < end, `${text}: statusword ${status(0xffff).toString(16)}`);
        }
        console.log('ok', text);
    };
    // All of the bus: this device sends no PDO before it is started, too.
    device.nmt.startNode(0);
    for (const [word, state] of [[0x06, 0x21], [0x07, 0x23], [0x0f, 0x27]])
        await until(() => status(0x6f) === state, word, 0, `controlword ${word}`);
    const shown = await upload(joint.findEntry('modes of operation display')[0].index, 0);
    check(shown.readInt8() === PROFILE_VELOCITY, 'profile velocity is shown');
    for (const speed of [400, -300])
        await until(async () => status(0x400) && Math.abs(await velocity() - speed) < 30, 0x0f, speed, `${speed} mrad/s is reached`);
    await until(() => status(0x1000), 0x0f, 0, 'the joint stands');
    await until(() => status(0x6f) === 0x40, 0, 0, 'it is switched off');
}

compare().then(drive).then(() => {
    console.log('done');
    process.exit(0);
}).catch((error) => {
    console.log('FAILED', error);
    process.exit(1);
});
