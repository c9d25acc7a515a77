//! Services of the board for the objects: configurations and friction models to the control step, records to flash.
//! Thread mode.

use super::super::{adaptation, load};
use super::store::Store;
use crate::board::{self, BoardConfiguration, Offering, Prepared, Subscriber, oscillator, shadow};
use canopen_node::{Event, Reset};
use core::cell::RefCell;
use friction_compensation::friction::regime::MAX_SETS;
use friction_compensation::parameters::authentication::CHALLENGE;
use friction_compensation::parameters::fault_log::LoggedFault;
use friction_compensation::parameters::guard::Guard;
use friction_compensation::parameters::image::Image;
use friction_compensation::parameters::slots::SlotError;
use joint_firmware::hardware::Hardware;
use joint_firmware::joint::Active;
use joint_firmware::joint::configuration::{BridgeConfiguration, Configuration, ConfigurationError};
use joint_firmware::joint::history::History;
use joint_firmware::motor::open_loop::Window;
use joint_firmware::motor::thermal::ThermalSettings;
use joint_firmware::objects::{NotConfigured, Program, Start};
use joint_firmware::reset_record::LastReset;

const _: () = assert!(
    board::CONFIGURATION.parameter_sets == MAX_SETS,
    "the board's room for parameter sets is what was compiled"
);

/// The program around the objects.
pub struct BoardProgram {
    /// Configurations to the control step.
    pub active: Offering<Active>,
    window: RefCell<Subscriber<Window>>,
    /// The flash.
    pub store: Store,
    /// Guard as kept in flash.
    pub guard: Guard,
    /// The master asked for a start of the whole program.
    pub restart: bool,
    /// The master asked for the chip's option bytes to be set.
    pub set_options: bool,
}

impl BoardProgram {
    /// Program with what the flash holds.
    pub fn new(active: Offering<Active>, window: Subscriber<Window>, mut store: Store) -> Self {
        let guard = store.guard();
        Self { active, window: RefCell::new(window), store, guard, restart: false, set_options: false }
    }

    /// Start of the objects.
    #[inline(never)]
    pub fn start(&mut self) -> Start {
        let BoardConfiguration { bridge, joint, .. } = &board::CONFIGURATION;
        // This falls back to what was stored before where the newest is damaged.
        self.store.find_record();
        let mut start = Start::new(self.store.record(), self.store.is_record_lost(), joint, bridge);
        (start.single_bank, start.stores_left) = (board::SINGLE_BANK, board::faults::stores_left());
        start
    }

    /// Offers the first configuration, with the friction model in flash. Returns what the thermal model needs.
    #[inline(never)]
    pub fn begin(&mut self, configuration: &Configuration) -> Result<ThermalSettings, ConfigurationError> {
        let image = self.store.image().unwrap_or_default();
        // The place is free: nothing has been offered.
        let prepared = defmt::unwrap!(prepare(&mut self.active, configuration, image))?;
        let thermal = prepared.value().thermal;
        put_to_use(prepared, true);
        Ok(thermal)
    }

    /// Has the control step take the friction model of an image with the configuration in use; false while it has not
    /// taken what it was offered before.
    pub fn run(&mut self, configuration: &Configuration, image: &[u8]) -> bool {
        offer(&mut self.active, configuration, image)
    }

    /// The same with the image in flash, or none where there is none.
    pub fn run_stored(&mut self, configuration: &Configuration) -> bool {
        let image = self.store.image().unwrap_or_default();
        offer(&mut self.active, configuration, image)
    }
}

/// The configuration was prepared before, when it came into use; `image` is empty where there is none.
fn offer(active: &mut Offering<Active>, configuration: &Configuration, image: &[u8]) -> bool {
    match prepare(active, configuration, image) {
        Some(Ok(prepared)) => {
            put_to_use(prepared, true);
            true
        }
        _ => false,
    }
}

/// Offers what is prepared to the control step, and tells the tasks that use it; with another friction model or the one
/// before.
fn put_to_use(prepared: Prepared<Active>, new_model: bool) {
    adaptation::prepared(prepared.value(), new_model);
    load::prepared(prepared.value());
    prepared.offer();
}

/// The friction model is prepared in its place, because the stack would not bear it beside the rest.
#[inline(never)]
fn prepare<'a>(
    active: &'a mut Offering<Active>,
    configuration: &Configuration,
    image: &[u8],
) -> Option<Result<Prepared<'a, Active>, ConfigurationError>> {
    shadow::withdraw();
    active.prepare(
        |place| configuration.prepare_in(&board::CONFIGURATION.bridge, place),
        |place, _| Image::prepare(image, board::CONFIGURATION.bridge.motion_rate(), &mut place.friction),
    )
}

impl Program for BoardProgram {
    fn configure(&mut self, configuration: &Configuration) -> Result<(), NotConfigured> {
        let bridge = &board::CONFIGURATION.bridge;
        shadow::withdraw();
        let prepared = self.active.prepare(
            |place| configuration.prepare_in(bridge, place),
            |place, in_use| {
                if let Some(model) = in_use.and_then(|in_use| in_use.friction.as_ref()) {
                    model.copy_to(&mut place.friction);
                }
            },
        );
        let prepared = prepared.ok_or(NotConfigured::Busy)?.map_err(NotConfigured::Refused)?;
        put_to_use(prepared, false);
        oscillator::trim(configuration.oscillator_trim);
        Ok(())
    }

    fn window(&self) -> Window {
        // Borrowed for the length of this call only.
        self.window.try_borrow_mut().map_or(Window::NOTHING, |mut window| *window.newest())
    }

    fn bridge(&self) -> &BridgeConfiguration {
        &board::CONFIGURATION.bridge
    }

    fn record<R>(&self, read: impl FnOnce(Option<&[u8]>) -> R) -> R {
        read(self.store.record())
    }

    fn store(&mut self, record: &[u8]) -> Result<(), SlotError> {
        self.store.store_record(record)
    }

    fn damaged(&self) -> u8 {
        u8::from(self.store.has_damaged_image()) | u8::from(self.guard.locked) << 2
    }

    fn note_stores_left(&mut self, left: u8) {
        board::faults::keep_stores_left(left);
    }

    fn keep(&mut self, guard: &Guard) -> Result<(), SlotError> {
        self.store.keep(guard)?;
        self.guard = guard.clone();
        Ok(())
    }

    fn random(&mut self) -> Option<[u8; CHALLENGE]> {
        board::random::bytes()
    }

    fn button(&self) -> Option<bool> {
        board::button()
    }

    fn read_image(&mut self, offset: u32, out: &mut [u8]) -> bool {
        let bytes = self.store.piece_of_image(offset as usize, out.len());
        bytes.map(|bytes| out.iter_mut().zip(bytes).for_each(|(place, byte)| *place = *byte)).is_some()
    }

    fn history<R>(&self, read: impl FnOnce(&History) -> R) -> Option<R> {
        board::control::history(read)
    }

    fn last_reset(&self) -> LastReset {
        board::faults::last_reset()
    }

    fn log_fault(&mut self, code: u16, fault: u8, time: u32) -> bool {
        self.store.log_fault(code, fault, time)
    }

    fn count_power_up(&mut self) {
        self.store.count_power_up();
    }

    fn logged_faults(&self) -> impl Iterator<Item = LoggedFault> {
        self.store.logged_faults()
    }

    fn power_ups(&self) -> u32 {
        self.store.power_ups()
    }

    fn hardware(&self) -> Hardware {
        board::hardware()
    }

    fn set_options(&mut self) -> bool {
        self.set_options = true;
        true
    }

    fn event(&mut self, event: Event) {
        match event {
            // The interrupt tells the joint.
            Event::State(_) => board::can::attend(),
            Event::Reset(Reset::Node) => self.restart = true,
            _ => {}
        }
    }
}
