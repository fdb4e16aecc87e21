//! One state, as an invariant sees it.

use crate::bid::Bid;
use crate::board::Owner;
use crate::bthread::BThread;
use crate::event::Event;

use super::locals::{Local, Locals};

/// One state of a program under verification.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    locals: &'a Locals,
    state: &'a [u32],
    /// The external queue, as event numbers.
    externals: &'a [u32],
}

impl<'a> View<'a> {
    pub(super) fn new(locals: &'a Locals, state: &'a [u32], externals: &'a [u32]) -> Self {
        Self { locals, state, externals }
    }

    /// The state of one b-thread, if it runs and is a `T`.
    pub fn state_of<T: BThread>(&self, name: &str) -> Option<&'a T> {
        let owner = self.locals().find(|local| &*local.name == name).map(|local| &local.owner)?;
        match owner {
            Owner::BThread(bthread) => bthread.as_any().downcast_ref(),
            Owner::Proxy => None,
        }
    }

    /// The b-threads that run, with their bids, in the order in which they were added.
    pub fn bids(&self) -> impl Iterator<Item = (&'a str, &'a Bid)> {
        self.locals().map(|local| (&*local.name, &local.bid))
    }

    /// The external queue, next event first.
    pub fn external_queue(&self) -> impl Iterator<Item = &'a Event> + use<'a> {
        let locals = self.locals;
        self.externals.iter().filter_map(|number| locals.events.get(*number))
    }

    fn locals(&self) -> impl Iterator<Item = &'a Local> + use<'a> {
        self.locals.of(self.state).filter(|local| !local.is_proxy())
    }
}
