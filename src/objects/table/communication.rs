//! 1000h to 1FFFh: what [`canopen`](canopen_node) serves, for the texts that a host makes. The server does not look
//! here; a test holds the two together.

use super::*;

mod general {
    use super::*;
    use Field::Server as S;
    room! {
        0x1000 "device type" { 0, "device type", U32, RO, UNMAPPED, S; "", 1.0, ANY; "00020192h: servo drive of CiA 402" }
        0x1001 "error register" { 0, "error register", U8, RO, UNMAPPED, S; "", 1.0, ANY; "A bit for each kind of error" }
        0x1003 "error history" {
            1, "error 1", U32, RO, UNMAPPED, S; "", 1.0, ANY; "Newest error: code, and two bytes of information"
            2, "error 2", U32, RO, UNMAPPED, S; "", 1.0, ANY; "The one before"
            3, "error 3", U32, RO, UNMAPPED, S; "", 1.0, ANY; "The one before"
            4, "error 4", U32, RO, UNMAPPED, S; "", 1.0, ANY; "The one before"
            5, "error 5", U32, RO, UNMAPPED, S; "", 1.0, ANY; "The one before"
            6, "error 6", U32, RO, UNMAPPED, S; "", 1.0, ANY; "The one before"
            7, "error 7", U32, RO, UNMAPPED, S; "", 1.0, ANY; "The one before"
            8, "error 8", U32, RO, UNMAPPED, S; "", 1.0, ANY; "The one before"
        }
        0x1005 "COB-ID SYNC" { 0, "COB-ID SYNC", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Identifier of SYNC; one less than 180 us after another does not count" }
        0x1008 "device name" { 0, "device name", Text, RO, UNMAPPED, S; "", 1.0, ANY; "Name of the device" }
        0x1009 "hardware version" { 0, "hardware version", Text, RO, UNMAPPED, S; "", 1.0, ANY; "The board" }
        0x100A "software version" { 0, "software version", Text, RO, UNMAPPED, S; "", 1.0, ANY; "The program" }
        0x1010 "store parameters" {
            1, "store all", U32, RW, UNMAPPED, S; "", 1.0, ANY; "\"save\" stores communication and application"
            2, "store communication", U32, RW, UNMAPPED, S; "", 1.0, ANY; "\"save\" stores 1000h to 1FFFh"
            3, "store application", U32, RW, UNMAPPED, S; "", 1.0, ANY; "\"save\" stores the configuration in use"
        }
        0x1011 "restore default parameters" {
            1, "restore all", U32, RW, UNMAPPED, S; "", 1.0, ANY; "\"load\": defaults after the next reset"
            2, "restore communication", U32, RW, UNMAPPED, S; "", 1.0, ANY; "\"load\": 1000h to 1FFFh"
            3, "restore application", U32, RW, UNMAPPED, S; "", 1.0, ANY; "\"load\": the configuration"
        }
        0x1014 "COB-ID EMCY" { 0, "COB-ID EMCY", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Identifier of EMCY" }
        0x1015 "inhibit time EMCY" { 0, "inhibit time EMCY", U16, RW, UNMAPPED, S; "s", 1e-4, ANY; "Least distance of two EMCYs" }
        0x1016 "consumer heartbeat time" {
            1, "heartbeat consumer 1", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Node id in bits 16 to 22, ms in bits 0 to 15"
            2, "heartbeat consumer 2", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Node id in bits 16 to 22, ms in bits 0 to 15"
            3, "heartbeat consumer 3", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Node id in bits 16 to 22, ms in bits 0 to 15"
            4, "heartbeat consumer 4", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Node id in bits 16 to 22, ms in bits 0 to 15"
        }
        0x1017 "producer heartbeat time" {
            0, "producer heartbeat time", U16, RW, UNMAPPED, S; "s", 1e-3, ANY; "Distance of two heartbeats; 0 none"
        }
        0x1018 "identity" {
            1, "vendor", U32, RO, UNMAPPED, S; "", 1.0, ANY; "Vendor"
            2, "product code", U32, RO, UNMAPPED, S; "", 1.0, ANY; "Product: what an image's target means"
            3, "revision number", U32, RO, UNMAPPED, S; "", 1.0, ANY; "Revision"
            4, "serial number", U32, RO, UNMAPPED, S; "", 1.0, ANY; "Serial number: what an image's target means"
        }
        0x1019 "synchronous counter overflow value" {
            0, "synchronous counter overflow value", U8, RW, UNMAPPED, S; "", 1.0, within(0.0, 240.0);
                "Value behind which the counter that SYNC carries begins anew at 1; 0: SYNC carries none. SYNC of another length counts all the same, and is EMCY 8240h. 1 is reserved, and refused"
        }
        0x1020 "verify configuration" {
            1, "configuration date", U32, RW, UNMAPPED, S; "", 1.0, ANY;
                "Days since 1984-01-01 of the configuration, as its tool says. Stored by 1010h:1; 0 as soon as any other object that 1010h stores gets another value, and after 1010h:2, 1010h:3 and 1011h"
            2, "configuration time", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Milliseconds since midnight, likewise"
        }
        0x1029 "error behaviour" {
            1, "communication error", U8, RW, UNMAPPED, S; "", 1.0, within(0.0, 2.0);
                "0 leaves OPERATIONAL for PRE-OPERATIONAL, 1 changes nothing, 2 stops"
        }
        0x1200 "SDO server parameter" {
            1, "COB-ID client to server", U32, RO, UNMAPPED, S; "", 1.0, ANY; "Identifier of requests"
            2, "COB-ID server to client", U32, RO, UNMAPPED, S; "", 1.0, ANY; "Identifier of answers"
        }
    }
}

/// Communication and mapping parameters of one PDO.
macro_rules! pdo {
    ($module:ident, $communication:literal, $mapping:literal, $name:literal, $map:literal $(, $inhibit:literal, $start:literal)?) => {
        mod $module {
            use super::*;
            use Field::Server as S;
            pub(super) const COMMUNICATION: Room = {
                room! {
                    $communication $name {
                        1, "COB-ID", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Identifier; bit 31: the PDO does not exist"
                        2, "transmission type", U8, RW, UNMAPPED, S; "", 1.0, ANY; "With SYNC: 1 to 240 every so many, 0 where something has changed. 254 and 255: on a change, and by the event timer"
                        $($inhibit, "inhibit time", U16, RW, UNMAPPED, S; "s", 1e-4, ANY; "Least distance of two transmissions of type 254 or 255")?
                        5, "event timer", U16, RW, UNMAPPED, S; "s", 1e-3, ANY;
                            "A TPDO is sent, an RPDO has to arrive so often; 0 never"
                        $($start, "SYNC start value", U8, RW, UNMAPPED, S; "", 1.0, within(0.0, 240.0);
                            "Of types 1 to 240, while 1019h is not 0: the SYNC with this counter is the first that counts; 0: any. Only while the PDO does not exist")?
                    }
                }
                ROOM
            };
            pub(super) const MAPPING: Room = {
                room! {
                    $mapping $map {
                        1, "object 1", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Index, sub-index, bits"
                        2, "object 2", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Index, sub-index, bits"
                        3, "object 3", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Index, sub-index, bits"
                        4, "object 4", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Index, sub-index, bits"
                        5, "object 5", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Index, sub-index, bits"
                        6, "object 6", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Index, sub-index, bits"
                        7, "object 7", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Index, sub-index, bits"
                        8, "object 8", U32, RW, UNMAPPED, S; "", 1.0, ANY; "Index, sub-index, bits"
                    }
                }
                ROOM
            };
        }
    };
}

pdo!(receive_1, 0x1400, 0x1600, "RPDO 1 communication parameter", "RPDO 1 mapping parameter");
pdo!(receive_2, 0x1401, 0x1601, "RPDO 2 communication parameter", "RPDO 2 mapping parameter");
pdo!(receive_3, 0x1402, 0x1602, "RPDO 3 communication parameter", "RPDO 3 mapping parameter");
pdo!(receive_4, 0x1403, 0x1603, "RPDO 4 communication parameter", "RPDO 4 mapping parameter");
pdo!(transmit_1, 0x1800, 0x1A00, "TPDO 1 communication parameter", "TPDO 1 mapping parameter", 3, 6);
pdo!(transmit_2, 0x1801, 0x1A01, "TPDO 2 communication parameter", "TPDO 2 mapping parameter", 3, 6);
pdo!(transmit_3, 0x1802, 0x1A02, "TPDO 3 communication parameter", "TPDO 3 mapping parameter", 3, 6);
pdo!(transmit_4, 0x1803, 0x1A03, "TPDO 4 communication parameter", "TPDO 4 mapping parameter", 3, 6);

/// Rooms in the order of their indices.
pub(super) const ROOMS: [Room; 17] = [
    general::ROOM,
    receive_1::COMMUNICATION,
    receive_2::COMMUNICATION,
    receive_3::COMMUNICATION,
    receive_4::COMMUNICATION,
    receive_1::MAPPING,
    receive_2::MAPPING,
    receive_3::MAPPING,
    receive_4::MAPPING,
    transmit_1::COMMUNICATION,
    transmit_2::COMMUNICATION,
    transmit_3::COMMUNICATION,
    transmit_4::COMMUNICATION,
    transmit_1::MAPPING,
    transmit_2::MAPPING,
    transmit_3::MAPPING,
    transmit_4::MAPPING,
];
