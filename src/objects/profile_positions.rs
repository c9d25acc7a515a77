//! Positions of profile position mode, and the hand-shake by which a master gives them (CiA 402-2, "Profile position
//! mode"); the receive interrupt.

use crate::joint::state_machine::Controlword;

/// A position that the joint goes to, and one that waits until it is there; raw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Positions {
    current: i32,
    /// `true` if there is one.
    goes: bool,
    waiting: Option<i32>,
    /// The set-point that the controlword holds up was taken.
    acknowledged: bool,
    /// Changes with every position that is gone to, so that what was said of the one before is not taken for this
    /// one's.
    number: u8,
}

impl Positions {
    /// None yet.
    pub(super) const NONE: Self = Self { current: 0, goes: false, waiting: None, acknowledged: false, number: 0 };

    /// State without any; the numbers go on.
    pub(super) fn forgotten(&self) -> Self {
        Self { number: self.number, ..Self::NONE }
    }

    /// The same in its place.
    pub(super) fn forget(&mut self) {
        *self = self.forgotten();
    }

    /// The position that the joint goes to, and its number.
    pub(super) fn target(&self) -> Option<(i32, u8)> {
        self.goes.then_some((self.current, self.number))
    }

    /// Bit 12 of the statusword: the set-point was taken, or there is no place for another one.
    pub(super) fn are_acknowledged(&self) -> bool {
        self.acknowledged || self.waiting.is_some()
    }

    /// Takes `position` where "new set-point" `rises` in the controlword: at once, or behind the one that the joint
    /// goes to. `actual` is where it is.
    pub(super) fn hand_shake(&mut self, word: Controlword, rises: bool, position: i32, actual: i32) {
        if !word.is_new_set_point() {
            self.acknowledged = false;
            return;
        }
        let at_once = word.changes_at_once() || !self.goes;
        // One that is gone to, one that waits: what comes then is not acknowledged, and has to come again.
        if !rises || !at_once && self.waiting.is_some() {
            return;
        }
        // Without a target so far: from where the joint is.
        let from = if self.goes { self.waiting.filter(|_| !at_once).unwrap_or(self.current) } else { actual };
        let target = if word.is_relative() { from.saturating_add(position) } else { position };
        self.acknowledged = true;
        if at_once {
            self.go_to(target);
        } else {
            self.waiting = Some(target);
        }
    }

    /// Goes on to the position that waits, where the one before was `reached`; whether there is one.
    pub(super) fn go_on(&mut self, reached: Option<u8>) -> bool {
        if reached != Some(self.number) {
            return false;
        }
        let Some(next) = self.waiting else { return false };
        self.go_to(next);
        true
    }

    fn go_to(&mut self, target: i32) {
        (self.current, self.goes, self.waiting) = (target, true, None);
        self.number = self.number.wrapping_add(1);
    }
}
