//! The events that may be selected in a state.

use crate::program::Strategy;
use crate::verify::bits::{has, union};
use crate::verify::locals::{Kind, Local};
use crate::verify::product::{Product, Scratch};

impl Product {
    /// Fills `scratch.blocked`, and `scratch.open` with the internal events that may be selected.
    pub(super) fn find_open(&mut self, state: &[u32]) {
        let Scratch { blocked, open, own, .. } = &mut self.scratch;
        let locals = &self.locals;
        let ids = state.get(1..).unwrap_or_default();
        union(blocked, locals.width(), ids.iter().map(|id| locals.bits(*id, Kind::Blocks)));
        own.clear();
        own.extend(ids.iter().filter(|id| !locals.get(**id).is_some_and(|local| local.is_world)));
        let ids = own;
        match locals.rules.strategy {
            Strategy::Simple => {
                union(open, locals.width(), ids.iter().map(|id| locals.bits(*id, Kind::Requests)));
                open.iter_mut().zip(&*blocked).for_each(|(open, blocked)| *open &= !blocked);
            }
            Strategy::Ordered => {
                let first =
                    |local: &Local| local.requests.iter().copied().find(|event| !has(blocked, *event));
                union(open, locals.width(), std::iter::empty());
                for event in ids.iter().filter_map(|id| locals.get(*id)).filter_map(first) {
                    if let Some(word) = open.get_mut(event as usize / 64) {
                        *word |= 1 << (event % 64);
                    }
                }
            }
            Strategy::SyncPriority | Strategy::BThreadPriority => {
                let is_open = |id: &&u32| {
                    locals.bits(**id, Kind::Requests).iter().zip(&*blocked).any(|(r, b)| r & !b != 0)
                };
                let rank = |id: &u32| locals.get(*id).and_then(|local| local.rank);
                let best = ids.iter().filter(is_open).map(rank).max();
                let foremost = ids.iter().filter(|id| Some(rank(id)) == best);
                union(open, locals.width(), foremost.map(|id| locals.bits(*id, Kind::Requests)));
                open.iter_mut().zip(&*blocked).for_each(|(open, blocked)| *open &= !blocked);
            }
        }
    }

    /// Fills `scratch.open` with what the world requests and nobody blocks. Needs `scratch.blocked`.
    pub(super) fn find_open_to_world(&mut self, state: &[u32]) {
        let Scratch { blocked, open, .. } = &mut self.scratch;
        let locals = &self.locals;
        let ids = state.iter().skip(1);
        let world = ids.filter(|id| locals.get(**id).is_some_and(|local| local.is_world));
        union(open, locals.width(), world.map(|id| locals.bits(*id, Kind::Requests)));
        open.iter_mut().zip(&*blocked).for_each(|(open, blocked)| *open &= !blocked);
    }

    /// The position in the queue of the external event whose turn it is. Needs `scratch.blocked`.
    pub(super) fn next_external(&self, state: &[u32]) -> Option<usize> {
        if state.len() < 2 {
            return None;
        }
        let home = |event: u32| {
            self.locals.events.get(event).is_some_and(|event| self.locals.rules.home.contains(event))
        };
        let queue = &self.beside(state)?.externals;
        queue.iter().position(|event| !has(&self.scratch.blocked, *event) && home(*event))
    }
}
