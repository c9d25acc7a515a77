//! The node on the bus, put together once at start from what lies in flash.

use super::bus::Node;
use super::program::BoardProgram;
use crate::board::{self, Publisher, can};
use canopen_node::{Identity, SdoSettings, Server};
use embassy_stm32::can::CanConfigurator;
use friction_compensation::parameters::authentication::STAGING;
use friction_compensation::parameters::image::Target;
use friction_compensation::parameters::life_cycle::LifeCycle;
use joint_firmware::joint::Demand;
use joint_firmware::objects::{Images, JointImage, Objects, Ownership, Shared, Start, StoredImages};
use static_cell::{ConstStaticCell, StaticCell};

/// Device profile 402, a servo drive.
const DEVICE_TYPE: u32 = 0x0002_0192;
/// Number of the chip, for a serial number: CRC-32 of its 96 bits.
const CRC: crc::Crc<u32, crc::NoTable> = crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC);

static BUS: canopen_node::Shared = canopen_node::Shared::new();
static OBJECTS: Shared = Shared::new();

/// Starts the receive interrupt; the rest is the task's. A function of its own, as all steps of the start: what each
/// takes of the stack is free again for the next.
#[inline(never)]
pub fn start(
    mut program: BoardProgram,
    start: &Start,
    demand: Publisher<Demand>,
    controller: CanConfigurator<'static>,
) -> &'static mut Node {
    let identity = identity();
    let stored = program.store.stored_images();
    let images = images(&program, &stored, identity);
    let objects = objects(program, images, start);
    let node = node(identity, start.configuration.node_id, objects, stored);
    can::start(controller, &BUS, JointImage::new(&OBJECTS), demand);
    node
}

#[inline(never)]
fn identity() -> &'static Identity<'static> {
    static IDENTITY: StaticCell<Identity> = StaticCell::new();
    IDENTITY.init(Identity {
        device_type: DEVICE_TYPE,
        device_name: board::NAME,
        hardware_version: board::NAME,
        software_version: env!("CARGO_PKG_VERSION"),
        // Nobody's.
        vendor: 0,
        product: board::PRODUCT,
        revision: 1,
        serial: CRC.checksum(&embassy_stm32::uid::uid()),
    })
}

/// The life of images.
#[inline(never)]
fn images(program: &BoardProgram, stored: &StoredImages, identity: &Identity) -> Images<'static> {
    static BUFFER: ConstStaticCell<[u8; STAGING]> = ConstStaticCell::new([0; STAGING]);

    let target = Target { product: board::PRODUCT, serial: identity.serial };
    let life = LifeCycle::new(target, program.guard.floor, program.guard.failures);
    Images::new(BUFFER.take(), life, Ownership::new(&program.guard), *stored)
}

/// The task's part of the node.
#[inline(never)]
fn node(
    identity: &'static Identity<'static>,
    node_id: u8,
    objects: &'static mut Objects<'static, BoardProgram>,
    stored: StoredImages,
) -> &'static mut Node {
    static NODE: StaticCell<Node> = StaticCell::new();

    let settings = SdoSettings { block_size: can::BLOCK, ..SdoSettings::default() };
    NODE.init(Node::new(&BUS, Server::new(&BUS, identity, settings, node_id), objects, stored))
}

/// A function of its own, because the stack bears the objects twice in it.
#[inline(never)]
fn objects(
    program: BoardProgram,
    images: Images<'static>,
    start: &Start,
) -> &'static mut Objects<'static, BoardProgram> {
    static PLACE: StaticCell<Objects<BoardProgram>> = StaticCell::new();
    PLACE.init_with(|| Objects::new(&OBJECTS, program, images, start))
}
