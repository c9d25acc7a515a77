//! Values that the control interrupt and a task hand to each other; who owns which place is
//! `joint_firmware::exchange`'s to say.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use joint_firmware::exchange::{self, Giver, Preparer, Taker, User};

/// The newest value, from one context to another; neither waits. Belongs into a static.
pub struct Newest<T> {
    sides: exchange::Newest,
    places: UnsafeCell<[T; 3]>,
}

// SAFETY: a place is used by the one side that owns it; a value moves between contexts, so it has to be `Send`.
unsafe impl<T: Send> Sync for Newest<T> {}

/// Writes values.
pub struct Publisher<T: 'static> {
    giver: Giver<'static>,
    places: &'static UnsafeCell<[T; 3]>,
}

/// Reads the newest value.
pub struct Subscriber<T: 'static> {
    taker: Taker<'static>,
    places: &'static UnsafeCell<[T; 3]>,
}

// SAFETY: as for `Newest`: the reference is used for the side's own place alone.
unsafe impl<T: Send> Send for Publisher<T> {}
// SAFETY: as above.
unsafe impl<T: Send> Send for Subscriber<T> {}

impl<T: Copy> Newest<T> {
    /// Place with `start`, which is read before anything was published.
    pub const fn new(start: T) -> Self {
        Self { sides: exchange::Newest::new(), places: UnsafeCell::new([start; 3]) }
    }

    /// Both sides, once.
    pub fn split(&'static self) -> Option<(Publisher<T>, Subscriber<T>)> {
        let (giver, taker) = self.sides.split()?;
        Some((Publisher { giver, places: &self.places }, Subscriber { taker, places: &self.places }))
    }
}

impl<T: Copy> Publisher<T> {
    /// Publishes a value.
    #[inline(always)]
    pub fn publish(&mut self, value: &T) {
        self.publish_in_place(|place| *place = *value);
    }

    /// Publishes what `write` leaves in a place, where it finds an older value: a large one is copied once only.
    #[inline(always)]
    pub fn publish_in_place(&mut self, write: impl FnOnce(&mut T)) {
        // SAFETY: the place is the giver's until it gives it, and one of the three.
        write(unsafe { &mut *self.places.get().cast::<T>().add(self.giver.place()) });
        self.giver.give();
    }
}

impl<T> Subscriber<T> {
    /// The newest value.
    #[inline(always)]
    pub fn newest(&mut self) -> &T {
        self.taker.take();
        // SAFETY: the place is the taker's until the next call, which this borrow rules out; it is one of the three.
        unsafe { &*self.places.get().cast::<T>().add(self.taker.place()) }
    }
}

/// A large value that is replaced as a whole, without a copy on the side that uses it. Belongs into a static.
pub struct Replaced<T> {
    sides: exchange::Handover,
    places: UnsafeCell<[MaybeUninit<T>; 2]>,
}

// SAFETY: as for `Newest`.
unsafe impl<T: Send> Sync for Replaced<T> {}

/// Offers values.
pub struct Offering<T: 'static> {
    preparer: Preparer<'static>,
    places: &'static UnsafeCell<[MaybeUninit<T>; 2]>,
}

/// Uses values.
pub struct InUse<T: 'static> {
    user: User<'static>,
    places: &'static UnsafeCell<[MaybeUninit<T>; 2]>,
}

// SAFETY: as for `Newest`.
unsafe impl<T: Send> Send for Offering<T> {}
// SAFETY: as above.
unsafe impl<T: Send> Send for InUse<T> {}

impl<T> Replaced<T> {
    /// Empty place: nothing offered yet. A value that is replaced is overwritten, not dropped.
    pub const fn new() -> Self {
        assert!(!core::mem::needs_drop::<T>());
        Self { sides: exchange::Handover::new(), places: UnsafeCell::new([const { MaybeUninit::uninit() }; 2]) }
    }

    /// Both sides, once.
    pub fn split(&'static self) -> Option<(Offering<T>, InUse<T>)> {
        let (preparer, user) = self.sides.split()?;
        Some((Offering { preparer, places: &self.places }, InUse { user, places: &self.places }))
    }
}

/// A value that lies in its place and waits to be offered.
pub struct Prepared<'a, T: 'static> {
    preparer: &'a mut Preparer<'static>,
    value: &'a T,
}

impl<T> Offering<T> {
    /// The place for the next value, which is of no use to anybody until one is prepared; none while the one before has
    /// not been taken.
    pub fn spare(&mut self) -> Option<&mut MaybeUninit<T>> {
        let place = self.preparer.place()?;
        // SAFETY: the place is the preparer's until it is offered, and it is one of the two.
        Some(unsafe { &mut *self.places.get().cast::<MaybeUninit<T>>().add(place) })
    }

    /// Has a value made in its place, and finished there, looking at the one in use; none, and nothing happens, while
    /// the one before has not been taken.
    pub fn prepare<E>(
        &mut self,
        make: impl for<'a> FnOnce(&'a mut MaybeUninit<T>) -> Result<&'a mut T, E>,
        finish: impl FnOnce(&mut T, Option<&T>),
    ) -> Option<Result<Prepared<'_, T>, E>> {
        let place = self.preparer.place()?;
        // SAFETY: the place in use was written before it was offered, its user only reads it, and it changes hands no
        // earlier than another value is offered, which needs the borrow that this one is part of.
        let in_use = self
            .preparer
            .in_use()
            .map(|place| unsafe { (*self.places.get().cast::<MaybeUninit<T>>().add(place)).assume_init_ref() });
        // SAFETY: the place is the preparer's until it is offered, which needs the borrow that this one becomes; it is
        // one of the two.
        let place = unsafe { &mut *self.places.get().cast::<MaybeUninit<T>>().add(place) };
        let address = place.as_ptr();
        Some(match make(place) {
            // Another value than the one in the place would leave that without one.
            Ok(value) if !core::ptr::eq(value, address) => return None,
            Ok(value) => {
                finish(value, in_use);
                Ok(Prepared { value, preparer: &mut self.preparer })
            }
            Err(error) => Err(error),
        })
    }
}

impl<T> Prepared<'_, T> {
    /// The value.
    pub fn value(&self) -> &T {
        self.value
    }

    /// Offers it: in use from the next control step on.
    pub fn offer(self) {
        self.preparer.offer();
    }
}

impl<T> InUse<T> {
    /// The value offered last, from now until the next call; none before the first.
    #[inline(always)]
    pub fn current(&mut self) -> Option<&T> {
        self.user.take();
        let place = self.user.place()?;
        // SAFETY: the place is the user's until the next call, which this borrow rules out; it is one of the two, and
        // written before it was offered.
        Some(unsafe { (*self.places.get().cast::<MaybeUninit<T>>().add(place)).assume_init_ref() })
    }
}
