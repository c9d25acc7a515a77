//! A board that `jointctl commission` talks to, in emulated time.

use super::Bench;
use super::master::send;
use bus::client::sdo::{Failure, Method, Settings, Transfer};
use bus::client::{Command, Object};
use emulator::board::Wired;
use jointctl::commission::joint::Objects;
use jointctl::commission::{Guide, Stage, Stopped};
use std::cell::Cell;
use std::rc::Rc;

/// Called before each object that the client reads: with the board, and the stage that it is in.
type Reading<'w, W> = Box<dyn FnMut(&Bench<W>, Stage) + 'w>;

/// A board with a node id.
pub struct OnBoard<'w, W: Wired> {
    /// The board.
    pub bench: Bench<W>,
    node: u8,
    stage: Rc<Cell<Stage>>,
    reading: Option<Reading<'w, W>>,
}

impl<'w, W: Wired> OnBoard<'w, W> {
    /// A board that has booted with a node id, and who tells its stages.
    pub fn new(bench: Bench<W>, node: u8) -> (Self, Telling) {
        let stage = Rc::new(Cell::new(Stage::Checks));
        let telling = Telling { stage: Rc::clone(&stage), told: Vec::new() };
        (Self { bench, node, stage, reading: None }, telling)
    }

    /// Has `reading` called before each object that the client reads.
    #[must_use]
    pub fn watched(self, reading: impl FnMut(&Bench<W>, Stage) + 'w) -> Self {
        Self { reading: Some(Box::new(reading)), ..self }
    }

    fn transfer(&mut self, transfer: Transfer) -> Result<Vec<u8>, Stopped> {
        let object = transfer.object();
        let ended = |error: libtest_mimic::Failed| Stopped::Bus(error.message().unwrap_or_default().into());
        match self.bench.transfer(transfer).map_err(ended)? {
            Ok(bytes) => Ok(bytes),
            Err(Failure::Aborted(abort)) => Err(Stopped::Refused(format!("{object:?}: {:08X}h", abort.0))),
            Err(failure) => Err(Stopped::Bus(format!("{object:?}: {failure:?}"))),
        }
    }
}

impl<W: Wired> Objects for OnBoard<'_, W> {
    fn upload(&mut self, index: u16, sub_index: u8) -> Result<Vec<u8>, Stopped> {
        if let Some(reading) = &mut self.reading {
            reading(&self.bench, self.stage.get());
        }
        let object = Object { node: self.node, index, sub_index };
        self.transfer(Transfer::upload(object, Method::Automatic, Settings::default()))
    }

    fn download(&mut self, index: u16, sub_index: u8, data: &[u8]) -> Result<(), Stopped> {
        let object = Object { node: self.node, index, sub_index };
        self.transfer(Transfer::download(object, data, Method::Automatic, Settings::default())).map(drop)
    }

    fn network(&mut self, command: Command) -> Result<(), Stopped> {
        let ended = |error: libtest_mimic::Failed| Stopped::Bus(error.message().unwrap_or_default().into());
        send(&mut self.bench.emulation, 0, &[command as u8, self.node]).map_err(ended)?;
        match command {
            Command::ResetNode | Command::ResetCommunication => self.bench.booted(self.node).map_err(ended),
            Command::Start | Command::Stop | Command::EnterPreOperational => Ok(()),
        }
    }

    fn pass(&mut self, seconds: f64) -> Result<(), Stopped> {
        self.bench.run(seconds).map_err(|error| Stopped::Bus(error.message().unwrap_or_default().into()))
    }
}

/// Says yes to everything, and remembers what it was told.
#[derive(Debug)]
pub struct Telling {
    stage: Rc<Cell<Stage>>,
    /// Lines of all that it was told.
    pub told: Vec<String>,
}

impl Guide for Telling {
    fn stage(&mut self, stage: Stage) {
        self.stage.set(stage);
        self.told.push(stage.name().into());
    }

    fn found(&mut self, text: &str) {
        self.told.push(format!("    {text}"));
    }

    fn agrees(&mut self, _: &str) -> bool {
        true
    }
}
