// slcan by TCP, for what drives a virtual joint with node-canopen.

const net = require('net');

/** A channel as node-canopen wants it: slcan text over TCP. */
class Slcan {
    constructor(port, receive) {
        this.socket = net.connect(port, '127.0.0.1');
        this.socket.setNoDelay(true);
        let text = '';
        this.socket.on('data', (bytes) => {
            const lines = (text + bytes.toString('latin1')).split(/[\r\x07]/);
            text = lines.pop();
            for (const line of lines.filter((line) => line.startsWith('t')))
                receive({ id: parseInt(line.slice(1, 4), 16), data: Buffer.from(line.slice(5), 'hex') });
        });
        this.socket.write('S8\rO\r');
    }

    send({ id, data }) {
        const text = [...data].map((byte) => byte.toString(16).padStart(2, '0')).join('');
        this.socket.write(`t${id.toString(16).padStart(3, '0')}${data.length}${text}\r`);
    }
}

module.exports = { Slcan };
