//! The node on the bus, put together once at start from what lies in flash.

use super::bus::Node;
use super::program::BoardProgram;
use crate::board::{self, Publisher, can};
use embassy_stm32::can::CanConfigurator;
use joint_firmware::canopen::{self, Identity, SdoSettings, Server};
use joint_firmware::joint::Demand;
use joint_firmware::joint::configuration::Configuration;
use joint_firmware::objects::{Images, JointImage, Objects, Shared, Start};
use joint_firmware::parameters::authentication::STAGING;
use joint_firmware::parameters::certificate::Limits;
use joint_firmware::parameters::image::{Effort, Target};
use joint_firmware::parameters::life_cycle::{LifeCycle, Requirements};
use static_cell::StaticCell;

/// Device profile 402, a servo drive.
const DEVICE_TYPE: u32 = 0x0002_0192;
/// Number of the chip, for a serial number: CRC-32 of its 96 bits.
const CRC: crc::Crc<u32, crc::NoTable> = crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC);

static BUS: canopen::Shared = canopen::Shared::new();
static OBJECTS: Shared = Shared::new();

/// Starts the receive interrupt; the rest is the task's. A function of its own, as all steps of the start: what each takes of the stack is free again
/// for the next.
#[inline(never)]
pub fn start(
    mut program: BoardProgram,
    configuration: &Configuration,
    demand: Publisher<Demand>,
    controller: CanConfigurator<'static>,
) -> &'static mut Node {
    static IDENTITY: StaticCell<Identity> = StaticCell::new();
    static BUFFER: StaticCell<[u8; STAGING]> = StaticCell::new();
    static NODE: StaticCell<Node> = StaticCell::new();

    let identity = IDENTITY.init(Identity {
        device_type: DEVICE_TYPE,
        device_name: board::NAME,
        hardware_version: board::NAME,
        software_version: env!("CARGO_PKG_VERSION"),
        // Nobody's.
        vendor: 0,
        product: board::PRODUCT,
        revision: 1,
        serial: CRC.checksum(&embassy_stm32::uid::uid()),
    });
    let images = program.store.stored_images();
    let kept = program.guard.floor;
    let floor = [images.active, images.previous].iter().flatten().map(|(image, _)| image.version).fold(kept, u32::max);
    let requirements = Requirements {
        target: Target { product: identity.product, serial: identity.serial },
        effort: Effort::NewtonMetre,
        // The image's own limits hold as well.
        limits: Limits {
            output: (configuration.limits.torque * 65_536.0) as u32,
            torque_gain: 1 << 16,
            velocity_slope: u32::MAX,
        },
    };
    let life = LifeCycle::new(requirements, floor, program.guard.failures, 0);
    let key = program.guard.key.clone();
    let images_of_client = Images::new(BUFFER.init([0; STAGING]), life, key, images);
    let start = Start { configuration: *configuration, stored: program.stored(), single_bank: board::SINGLE_BANK };
    let settings = SdoSettings { block_size: can::BLOCK, ..SdoSettings::default() };
    let server = Server::new(&BUS, identity, settings, configuration.node_id);
    let objects = objects(program, images_of_client, &start);
    let node = NODE.init(Node::new(&BUS, server, objects, images));
    can::start(controller, &BUS, JointImage::new(&OBJECTS), demand);
    node
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
