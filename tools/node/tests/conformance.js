// What node-canopen (npm: canopen) must be able to do with a joint. Run by node_canopen.rs against a virtual joint, over slcan by TCP; every
// check says what it is about.
//
//     node conformance.js MODULES PORT NODE FIRST.img SECOND.img

const [, , modules, port, id, firstPath, secondPath] = process.argv;
const { Device, DataType } = require(require.resolve('canopen', { paths: [modules] }));
const fs = require('fs');
const { Slcan } = require('./slcan.js');

const [TORQUE, VELOCITY, POSITION, IMPEDANCE, PROFILE_POSITION, HOMING] = [10, 9, 8, -1, 1, 6];
const node = Number(id);

function check(condition, text) {
    if (!condition) {
        console.log('FAILED', text);
        process.exit(1);
    }
    console.log('ok', text);
}

const device = new Device({ id: 0x7e });
const heartbeats = [];
const emergencies = [];
const channel = new Slcan(Number(port), (message) => {
    if (message.id === 0x700 + node)
        heartbeats.push(message.data[0]);
    device.receive(message);
});
device.addListener('message', (message) => channel.send(message));

// The joint's PDOs, as they are mapped at first.
const objects = {};
function object(index, name, dataType) {
    objects[name] = device.eds.addEntry(index, { parameterName: name, dataType });
    return objects[name];
}
const controlword = object(0x6040, 'controlword', DataType.UNSIGNED16);
device.eds.addTransmitPdo({
    cobId: 0x200 + node,
    transmissionType: 240,
    dataObjects: [
        controlword,
        object(0x6071, 'target torque', DataType.INTEGER16),
        object(0x607a, 'target position', DataType.INTEGER32),
    ],
});
device.eds.addTransmitPdo({
    cobId: 0x300 + node,
    transmissionType: 240,
    dataObjects: [
        controlword,
        object(0x6060, 'mode', DataType.INTEGER8),
        object(0x60ff, 'target velocity', DataType.INTEGER32),
    ],
});
device.eds.addTransmitPdo({
    cobId: 0x400 + node,
    transmissionType: 240,
    dataObjects: [
        object(0x2011, 'impedance, first half', DataType.UNSIGNED32),
        object(0x2012, 'impedance, second half', DataType.UNSIGNED32),
    ],
});
device.eds.addReceivePdo({
    cobId: 0x180 + node,
    dataObjects: [
        object(0x6041, 'statusword', DataType.UNSIGNED16),
        object(0x6077, 'torque', DataType.INTEGER16),
        object(0x6064, 'position', DataType.INTEGER32),
    ],
});
device.eds.addReceivePdo({
    cobId: 0x280 + node,
    dataObjects: [
        object(0x606c, 'velocity', DataType.INTEGER32),
        object(0x2020, 'compensation torque', DataType.INTEGER16),
        object(0x2021, 'residual torque', DataType.INTEGER16),
    ],
});
device.eds.addSdoClientParameter(node, 0x600 + node, 0x580 + node);
device.eds.addEmcyConsumer(0x080 + node);
device.eds.setHeartbeatProducerTime(50);
device.eds.setSyncCobId(0x080);
device.eds.setSyncGenerationEnable(true);
let pdos = 0;
device.pdo.on('pdo', () => ++pdos);
device.emcy.on('emergency', ({ em }) => emergencies.push(em.code));

const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const value = (name) => objects[name].value;
const state = () => value('statusword') & 0x6f;

/** Waits for a condition, doing something meanwhile; whether it came. */
async function until(condition, seconds = 10, each = () => sleep(10)) {
    const end = Date.now() + 1000 * seconds;
    while (!condition()) {
        if (Date.now() > end)
            return false;
        await each();
    }
    return true;
}

const at = (index, subIndex) => ({ deviceId: node, index, subIndex, timeout: 2000, blockInterval: 0 });
const upload = (index, subIndex = 0, blockTransfer = false) => device.sdo.upload({ ...at(index, subIndex), blockTransfer });
const download = (data, index, subIndex = 0, blockTransfer = false) =>
    device.sdo.download({ ...at(index, subIndex), data, blockTransfer });
const number = (dataType, index, subIndex = 0) => device.sdo.upload({ ...at(index, subIndex), dataType });
const write = (value, dataType, index, subIndex = 0) =>
    device.sdo.download({ ...at(index, subIndex), data: value, dataType });

async function cycle() {
    device.sync.write();
    await sleep(10);
}

/** RPDO 1 and SYNC. */
async function command(word, torque = 0, position = value('position')) {
    controlword.value = word;
    objects['target torque'].value = torque;
    objects['target position'].value = position;
    device.pdo.write(0x200 + node);
    await cycle();
}

/** RPDO 2 and SYNC. */
async function turn(velocity) {
    controlword.value = 0x0f;
    objects.mode.value = VELOCITY;
    objects['target velocity'].value = velocity;
    device.pdo.write(0x300 + node);
    await cycle();
}

const disable = () => until(() => state() === 0x40, 10, () => command(0));

/** From "switch on disabled" to "operation enabled". */
async function enable(mode) {
    await disable();
    await write(mode, DataType.INTEGER8, 0x6060);
    for (const [word, reached] of [[0x06, 0x21], [0x07, 0x23], [0x0f, 0x27]])
        check(await until(() => state() === reached, 10, () => command(word)), `mode ${mode}: controlword ${word}`);
    check(await number(DataType.INTEGER8, 0x6061) === mode, `mode ${mode} is shown`);
}

async function reset() {
    heartbeats.length = 0;
    device.nmt.resetNode(node);
    check(await until(() => heartbeats.includes(0)), 'a reset is followed by a boot-up message');
}

async function modes() {
    await enable(TORQUE);
    check(await until(() => value('velocity') > 100, 10, () => command(0x0f, 60)), 'a positive torque accelerates');
    check(await until(() => value('velocity') < -100, 10, () => command(0x0f, -60)), 'a negative one the other way');
    await enable(VELOCITY);
    const follows = await until(() => Math.abs(value('velocity') - 500) < 20, 10, () => turn(500));
    check(follows, 'a velocity is followed');
    check(await until(() => Math.abs(value('velocity')) < 20, 10, () => turn(0)), 'and so is zero');
    await enable(POSITION);
    const target = value('position') + 200000;
    const near = () => Math.abs(value('position') - target) < 10000;
    check(await until(near, 10, () => command(0x0f, 0, target)), 'a position is reached');
    await enable(PROFILE_POSITION);
    await write(500, DataType.UNSIGNED32, 0x6081);
    const far = value('position') + 150000;
    const taken = () => (value('statusword') & 0x1000) !== 0;
    check(await until(taken, 10, () => command(0x1f, 0, far)), 'a set-point is taken');
    check(await until(() => !taken(), 10, () => command(0x0f, 0, far)), 'and let go of');
    check(await until(() => (value('statusword') & 0x400) !== 0, 10, cycle), 'its target is reached, which nobody renews');
    check(Math.abs(value('position') - far) < 15000, 'where it should be');
    await enable(HOMING);
    await write(37, DataType.INTEGER8, 0x6098);
    await write(100000, DataType.INTEGER32, 0x607c);
    const homed = () => (value('statusword') & 0x3400) === 0x1400;
    check(await until(homed, 10, () => command(0x1f)), 'the joint is homed where it is');
    check(Math.abs(value('position') - 100000) < 5000, 'which has the home offset');
    await disable();
    const ranges = [12.5, 65, 500, 50, 18];
    await write(ranges[3], DataType.REAL32, 0x2012, 4);
    await enable(IMPEDANCE);
    // Position 16 bits, velocity, stiffness, damping, torque 12 bits each, most significant first.
    const back = value('position') * 1e-6 - 0.2;
    let bits = 0n;
    for (const [wanted, range, width, both] of [
        [back, ranges[0], 16, true], [0, ranges[1], 12, true], [300, ranges[2], 12, false], [20, ranges[3], 12, false],
        [0, ranges[4], 12, true],
    ]) {
        const part = both ? (wanted / range + 1) / 2 : wanted / range;
        bits = bits << BigInt(width) | BigInt(Math.round((2 ** width - 1) * part));
    }
    const frame = Buffer.alloc(8);
    frame.writeBigUInt64BE(bits);
    objects['impedance, first half'].raw = frame.subarray(0, 4);
    objects['impedance, second half'].raw = frame.subarray(4);
    const pulled = await until(() => Math.abs(value('position') * 1e-6 - back) < 0.03, 10, async () => {
        device.pdo.write(0x400 + node);
        await cycle();
    });
    check(pulled, 'an impedance frame pulls the joint to its position');
}

async function faults() {
    emergencies.length = 0;
    check(await until(() => emergencies.includes(0x8100)), 'without commands the joint reports EMCY 8100h');
    check(await number(DataType.UNSIGNED16, 0x603f) === 0x8100, 'the error code says the same');
    check((await number(DataType.UNSIGNED32, 0x1003, 1) & 0xffff) === 0x8100, 'and the history of errors');
    check((await upload(0x2300)).length === 64 * 36, 'the steps before the fault can be read');
    await until(() => state() === 0x40, 10, () => command(0x80));
    check(await until(() => emergencies.includes(0), 10, () => command(0)), 'a reset of the fault is EMCY 0000h');
}

async function heartbeat() {
    await write(50, DataType.UNSIGNED16, 0x1017);
    await sleep(100);
    heartbeats.length = 0;
    const began = Date.now();
    await sleep(1000);
    const [count, due] = [heartbeats.length, (Date.now() - began) / 50];
    check(count >= 0.5 * due && count <= 1.2 * due && heartbeats.every((beat) => beat === 5), 'a heartbeat every 50 ms says OPERATIONAL');
    // node-canopen's own heartbeat, which the joint watches.
    emergencies.length = 0;
    await write(0x7e << 16 | 1000, DataType.UNSIGNED32, 0x1016, 1);
    await sleep(500);
    check(!emergencies.includes(0x8130), 'a master that is heard is not missed');
    device.eds.setHeartbeatProducerTime(0);
    check(await until(() => emergencies.includes(0x8130)), 'a master that falls silent is: EMCY 8130h');
    check(await until(() => heartbeats.at(-1) === 0x7f), 'and the joint leaves OPERATIONAL');
    await write(0, DataType.UNSIGNED32, 0x1016, 1);
}

/** Stages and takes a command deadline, s. */
async function setting(value) {
    await write(value, DataType.REAL32, 0x2103, 11);
    await write(1, DataType.UNSIGNED8, 0x2100, 1);
}

async function configuration(standard) {
    await setting(0.25);
    await download(Buffer.from('save'), 0x1010, 1);
    await setting(0.5);
    await write(0, DataType.UNSIGNED16, 0x1017);
    await reset();
    const kept = await number(DataType.REAL32, 0x2103, 11) === 0.25 && await number(DataType.UNSIGNED16, 0x1017) === 50;
    check(kept, 'what is stored is there after a reset');
    await download(Buffer.from('load'), 0x1011, 1);
    await reset();
    const restored = await number(DataType.REAL32, 0x2103, 11) === standard && await number(DataType.UNSIGNED16, 0x1017) === 0;
    check(restored, 'defaults are restored');
}

async function images() {
    const command = (number) => write(number, DataType.UNSIGNED8, 0x2212, 1);
    const contents = [firstPath, secondPath].map((path) => fs.readFileSync(path));
    for (const [place, content] of contents.entries()) {
        await download(content, 0x2210, 0, true);
        await command(1);
        check(await number(DataType.UNSIGNED8, 0x2212, 2) === 2, `image ${place + 1} is verified`);
        await command(3);
        check(await number(DataType.UNSIGNED32, 0x2213, 1) === place + 1, `image ${place + 1} is active`);
        check(content.equals(await upload(0x2211, 0, true)), `image ${place + 1} is read back`);
    }
    emergencies.length = 0;
    const damaged = Buffer.from(contents[1]);
    damaged[60] ^= 1;
    await download(damaged, 0x2210);
    const refused = await command(1).then(() => false, (error) => error.code === 0x08000020);
    check(refused && await number(DataType.UNSIGNED16, 0x2212, 3) !== 0, 'a damaged image is refused, with a reason');
    check(await until(() => emergencies.includes(0x6320)), 'and reported by EMCY 6320h');
    await command(5);
    await command(4);
    const back = await number(DataType.UNSIGNED32, 0x2213, 1) === 1 && await number(DataType.UNSIGNED32, 0x2214, 1) === 2;
    check(back, 'a roll back brings the first image back');
}

async function main() {
    device.start();
    // A machine that runs many tests lets this program wait for longer than a joint without commands does before it brakes.
    const standard = await number(DataType.REAL32, 0x2103, 11);
    await setting(1);
    device.nmt.startNode(0);
    check(await until(() => pdos > 2, 10, cycle), 'SYNC is answered by TPDOs');
    const told = await number(DataType.INTEGER32, 0x6064);
    check(Math.abs(told - value('position')) < 2000, 'TPDO and SDO tell the same position');
    await modes();
    await faults();
    await heartbeat();
    await configuration(standard);
    await images();
    console.log('done');
    process.exit(0);
}

main().catch((error) => {
    console.log('FAILED', error);
    process.exit(1);
});
