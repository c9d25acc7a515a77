//! One face for all objects, the server's and the application's, and one SDO transfer's reading or writing of an
//! entry; the task.

use super::COUNTER_AND_DATE;
use super::abort::Abort;
use super::communication::{Communication, Object};
use super::dictionary::{Access, Entry, Length, ObjectDictionary};

/// Meaning of every index and sub-index.
#[derive(Debug)]
pub(super) struct Objects<'s, 'a, D> {
    pub(super) communication: Communication<'s, 'a>,
    pub(super) dictionary: &'s mut D,
}

impl<'a, D: ObjectDictionary> Objects<'_, 'a, D> {
    fn entry(&self, index: u16, sub_index: u8) -> Result<Entry, Abort> {
        match self.communication.find(index, sub_index) {
            Some(object) => Ok(object?.entry()),
            None => self.dictionary.entry(index, sub_index),
        }
    }

    /// Fills `out` from `offset` on.
    pub(super) fn read(&mut self, index: u16, sub_index: u8, offset: u32, out: &mut [u8]) -> Result<(), Abort> {
        match self.communication.find(index, sub_index) {
            None => self.dictionary.read(index, sub_index, offset, out),
            Some(object) => match object? {
                Object::Text(text) => copy(text.as_bytes(), offset, out),
                object => copy(&self.communication.read(object)?.to_le_bytes(), offset, out),
            },
        }
    }

    fn write(&mut self, index: u16, sub_index: u8, value: &[u8]) -> Result<(), Abort> {
        match self.communication.find(index, sub_index) {
            None => self.dictionary.write(index, sub_index, value),
            Some(object) => {
                let mut bytes = [0; 4];
                bytes.iter_mut().zip(value).for_each(|(byte, given)| *byte = *given);
                let object = object?;
                let watched = COUNTER_AND_DATE && object.is_stored();
                let before = if watched { self.communication.read(object).ok() } else { None };
                self.communication.write(object, u32::from_le_bytes(bytes), self.dictionary)?;
                if watched && self.communication.read(object).ok() != before {
                    self.communication.date([0; 2]);
                }
                Ok(())
            }
        }
    }
}

/// Fills `out` from `all`, from `offset` on.
fn copy(all: &[u8], offset: u32, out: &mut [u8]) -> Result<(), Abort> {
    let rest = all.get(offset as usize..).ok_or(Abort::GENERAL)?;
    let part = rest.get(..out.len()).ok_or(Abort::GENERAL)?;
    out.iter_mut().zip(part).for_each(|(byte, value)| *byte = *value);
    Ok(())
}

/// An entry that is being read.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source {
    index: u16,
    sub_index: u8,
    length: u32,
    /// A value is taken at once, so that a second frame of it belongs to the first.
    value: Option<[u8; 8]>,
}

impl Source {
    pub(super) fn open<D: ObjectDictionary>(
        objects: &mut Objects<'_, '_, D>,
        index: u16,
        sub_index: u8,
    ) -> Result<Self, Abort> {
        let entry = objects.entry(index, sub_index)?;
        if entry.access == Access::WriteOnly {
            return Err(Abort::WRITE_ONLY);
        }
        let (length, value) = match entry.length {
            Length::Stream { readable, .. } => (readable, None),
            Length::Value(bytes) => {
                let mut value = [0; 8];
                let bytes = bytes.min(8);
                let out = value.get_mut(..bytes.into()).ok_or(Abort::GENERAL)?;
                objects.read(index, sub_index, 0, out)?;
                (bytes.into(), Some(value))
            }
        };
        Ok(Self { index, sub_index, length, value })
    }

    /// Bytes of the whole entry.
    pub(super) fn length(&self) -> u32 {
        self.length
    }

    /// The up to seven bytes from `offset` on, how many they are, and whether they are the last.
    pub(super) fn segment<D: ObjectDictionary>(
        &self,
        objects: &mut Objects<'_, '_, D>,
        offset: u32,
    ) -> Result<([u8; 7], u8, bool), Abort> {
        let rest = self.length.saturating_sub(offset);
        let bytes = rest.min(7) as u8;
        let mut segment = [0; 7];
        let out = segment.get_mut(..bytes.into()).ok_or(Abort::GENERAL)?;
        match &self.value {
            _ if out.is_empty() => {}
            Some(value) => copy(value, offset, out)?,
            None => objects.read(self.index, self.sub_index, offset, out)?,
        }
        Ok((segment, bytes, rest <= 7))
    }
}

/// An entry that is being written. Ends with [`Sink::finish`] or [`Sink::abandon`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Sink {
    index: u16,
    sub_index: u8,
    /// Bytes of a value; none for a stream.
    value: Option<u8>,
    /// Bytes there may be.
    limit: u32,
    /// Bytes that the client announced.
    announced: Option<u32>,
    received: u32,
    bytes: [u8; 8],
}

impl Sink {
    pub(super) fn open<D: ObjectDictionary>(
        objects: &mut Objects<'_, '_, D>,
        index: u16,
        sub_index: u8,
        announced: Option<u32>,
    ) -> Result<Self, Abort> {
        let entry = objects.entry(index, sub_index)?;
        if entry.access == Access::ReadOnly {
            return Err(Abort::READ_ONLY);
        }
        let (limit, value) = match entry.length {
            Length::Value(bytes) => (bytes.min(8).into(), Some(bytes.min(8))),
            Length::Stream { writable, .. } => (writable, None),
        };
        if announced.is_some_and(|announced| announced > limit) {
            return Err(Abort::TOO_LONG);
        }
        if value.is_some() && announced.is_some_and(|announced| announced < limit) {
            return Err(Abort::TOO_SHORT);
        }
        if value.is_none() {
            objects.dictionary.open(index, sub_index, announced)?;
        }
        Ok(Self { index, sub_index, value, limit, announced, received: 0, bytes: [0; 8] })
    }

    /// Bytes that can still come.
    pub(super) fn rest(&self) -> u32 {
        self.announced.unwrap_or(self.limit).saturating_sub(self.received)
    }

    pub(super) fn push<D: ObjectDictionary>(
        &mut self,
        objects: &mut Objects<'_, '_, D>,
        data: &[u8],
    ) -> Result<(), Abort> {
        if data.len() as u32 > self.rest() {
            return Err(Abort::TOO_LONG);
        }
        if self.value.is_none() {
            if !data.is_empty() {
                objects.dictionary.append(self.received, data)?;
            }
        } else {
            let places = self.bytes.iter_mut().skip(self.received as usize);
            places.zip(data).for_each(|(place, byte)| *place = *byte);
        }
        self.received = self.received.saturating_add(data.len() as u32);
        Ok(())
    }

    /// Returns `true` if nothing announced is missing.
    fn is_whole(&self) -> bool {
        self.announced.is_none_or(|announced| announced == self.received)
            && self.value.is_none_or(|bytes| u32::from(bytes) == self.received)
    }

    /// The entry takes its new value, or refuses it; on an error the stream is abandoned.
    pub(super) fn finish<D: ObjectDictionary>(self, objects: &mut Objects<'_, '_, D>) -> Result<(), Abort> {
        let result = match self.value {
            _ if !self.is_whole() => Err(Abort::TOO_SHORT),
            None => objects.dictionary.finish(),
            Some(bytes) => {
                let value = self.bytes.get(..bytes.into()).unwrap_or(&self.bytes);
                objects.write(self.index, self.sub_index, value)
            }
        };
        if result.is_err() {
            self.abandon(objects.dictionary);
        }
        result
    }

    pub(super) fn abandon(self, dictionary: &mut impl ObjectDictionary) {
        if self.value.is_none() {
            dictionary.abandon();
        }
    }
}
