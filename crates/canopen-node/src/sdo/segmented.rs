//! Expedited and segmented transfers: CiA 301 sections 7.2.4.3.3 to 7.2.4.3.8.

use super::{Initiate, Message};
use crate::abort::Abort;
use crate::access::{Objects, Sink, Source};
use crate::dictionary::ObjectDictionary;

/// Opens what an "initiate download" writes.
pub(super) fn open<D: ObjectDictionary>(initiate: &Initiate, objects: &mut Objects<'_, '_, D>) -> Result<Sink, Abort> {
    let size_indicated = initiate.command & 1 != 0;
    let announced = match initiate.command & 2 != 0 {
        true => size_indicated.then(|| 4u32.saturating_sub((initiate.command >> 2 & 3).into())),
        false => size_indicated.then(|| initiate.number()),
    };
    Sink::open(objects, initiate.index, initiate.sub_index, announced)
}

/// The data of an expedited download. Without an indicated size it is as much of the four bytes as the entry takes.
pub(super) fn expedited<'a>(initiate: &'a Initiate, sink: &Sink) -> &'a [u8] {
    let length = sink.rest().min(4);
    initiate.data.get(..length as usize).unwrap_or(&initiate.data)
}

/// A segmented download.
#[derive(Debug, Default)]
pub(super) struct Download {
    toggle: bool,
}

impl Download {
    /// Takes a segment; the answer, and whether the segment was the last.
    pub(super) fn receive<D: ObjectDictionary>(
        &mut self,
        request: &Message,
        sink: &mut Sink,
        objects: &mut Objects<'_, '_, D>,
    ) -> Result<(Message, bool), Abort> {
        let [command, data @ ..] = request;
        if command >> 5 != 0 {
            return Err(Abort::COMMAND);
        }
        alternate(&mut self.toggle, *command)?;
        let bytes = 7u8.saturating_sub(command >> 1 & 7);
        sink.push(objects, data.get(..bytes.into()).unwrap_or(data))?;
        Ok(([0x20 | (command & TOGGLE), 0, 0, 0, 0, 0, 0, 0], command & 1 != 0))
    }
}

/// A segmented upload.
#[derive(Debug)]
pub(super) struct Upload {
    source: Source,
    offset: u32,
    toggle: bool,
}

impl Upload {
    pub(super) fn new(source: Source) -> Self {
        Self { source, offset: 0, toggle: false }
    }

    /// Takes the request for a segment; the segment, and whether it is the last.
    pub(super) fn receive<D: ObjectDictionary>(
        &mut self,
        request: &Message,
        objects: &mut Objects<'_, '_, D>,
    ) -> Result<(Message, bool), Abort> {
        let [command, ..] = *request;
        if command >> 5 != 3 {
            return Err(Abort::COMMAND);
        }
        alternate(&mut self.toggle, command)?;
        let ([a, b, c, d, e, f, g], bytes, last) = self.source.segment(objects, self.offset)?;
        self.offset = self.offset.saturating_add(bytes.into());
        let unused = 7u8.saturating_sub(bytes);
        Ok(([(command & TOGGLE) | unused << 1 | u8::from(last), a, b, c, d, e, f, g], last))
    }
}

const TOGGLE: u8 = 0x10;

/// The toggle bit begins with 0 and alternates with every segment.
fn alternate(expected: &mut bool, command: u8) -> Result<(), Abort> {
    if (command & TOGGLE != 0) != *expected {
        return Err(Abort::TOGGLE);
    }
    *expected = !*expected;
    Ok(())
}
