//! One state, as an invariant sees it.

use crate::bid::Bid;
use crate::board::Owner;
use crate::bthread::BThread;
use crate::event::Event;

use super::locals::Local;
use super::product::Product;

/// One state of a program under verification.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    product: &'a Product,
    state: &'a [u32],
}

impl<'a> View<'a> {
    pub(super) fn new(product: &'a Product, state: &'a [u32]) -> Self {
        Self { product, state }
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
    pub fn external_queue(&self) -> impl Iterator<Item = &'a Event> {
        self.product.queue(self.state)
    }

    fn locals(&self) -> impl Iterator<Item = &'a Local> + use<'a> {
        self.product.locals(self.state).filter(|local| !local.is_proxy())
    }
}
