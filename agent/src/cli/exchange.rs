//! The exchange between the threads of control and of the mission.

use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError, TryLockError};

use skein_zenoh::Bell;

use crate::apart::{News, Orders};

/// Two trays, and what else is known to both. Control never waits here: where the other thread has its hand
/// in a tray, it looks again at its next look.
pub struct Exchange {
    news: Mutex<News>,
    orders: Mutex<Orders>,
    to_control: Bell,
    to_mission: Bell,
    /// Counts how often control has gone on.
    pub beats: AtomicU64,
    /// Counts how often whoever is at this computer has asked the program to end.
    pub interruptions: AtomicU32,
    /// Whether the mission's thread has ended by itself.
    pub mission_is_gone: AtomicBool,
    /// Whether the mission's thread is to end.
    pub is_ending: AtomicBool,
}

impl Exchange {
    /// `to_mission` wakes the mission's thread.
    pub fn new(to_mission: Bell) -> Self {
        Self {
            news: Mutex::default(),
            orders: Mutex::default(),
            to_control: Bell::default(),
            to_mission,
            beats: AtomicU64::new(0),
            interruptions: AtomicU32::new(0),
            mission_is_gone: AtomicBool::new(false),
            is_ending: AtomicBool::new(false),
        }
    }

    /// Wakes control's thread.
    pub fn to_control(&self) -> &Bell {
        &self.to_control
    }

    /// For control: lays out its news, unless it has to wait for that; they are then left in `news`.
    pub fn put_news(&self, news: &mut News) {
        let mut tray = match self.news.try_lock() {
            Ok(tray) => tray,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return,
        };
        let is_urgent = !news.reports.is_empty() || news.order.is_some();
        tray.merge(std::mem::take(news));
        drop(tray);
        if is_urgent {
            self.to_mission.ring();
        }
    }

    /// For control: takes the mission's orders, unless it has to wait for that.
    pub fn take_orders(&self) -> Option<Orders> {
        match self.orders.try_lock() {
            Ok(mut tray) => Some(std::mem::take(&mut *tray)),
            Err(TryLockError::Poisoned(poisoned)) => Some(std::mem::take(&mut *poisoned.into_inner())),
            Err(TryLockError::WouldBlock) => None,
        }
    }

    /// For the mission: takes control's news.
    pub fn take_news(&self) -> News {
        std::mem::take(&mut *self.news.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// For the mission: lays out its orders.
    pub fn put_orders(&self, orders: Orders) {
        let is_urgent = !orders.instructions.is_empty();
        self.orders.lock().unwrap_or_else(PoisonError::into_inner).merge(orders);
        if is_urgent {
            self.to_control.ring();
        }
    }

    /// Counts one more wish that the program ends.
    pub fn interrupt(&self) {
        self.interruptions.fetch_add(1, Ordering::Relaxed);
        self.to_control.ring();
    }

    /// Has the mission's thread end.
    pub fn end(&self) {
        self.is_ending.store(true, Ordering::Relaxed);
        self.to_mission.ring();
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::instruction::Instruction;
    use crate::report::Report;

    fn news() -> News {
        let mut news = News::default();
        news.reports.put(Duration::ZERO, Report::Airborne);
        news
    }

    #[test]
    fn control_waits_for_nobody_who_has_a_hand_in_a_tray() {
        let exchange = Exchange::new(Bell::default());
        let mut news = news();
        let (first, second) = (exchange.news.lock().unwrap(), exchange.orders.lock().unwrap());
        exchange.put_news(&mut news);
        assert!(!news.reports.is_empty(), "its news are still its own");
        assert!(exchange.take_orders().is_none());
        drop((first, second));
        exchange.put_news(&mut news);
        assert!(news.reports.is_empty() && exchange.to_mission.wait(Duration::ZERO));
        assert!(exchange.take_orders().is_some());
    }

    #[test]
    fn a_land_stays_among_however_many_orders_nobody_takes() {
        let exchange = Exchange::new(Bell::default());
        let give = |ms, instruction| {
            let at = Duration::from_millis(ms);
            let mut orders = Orders { decided: at, ..Orders::default() };
            orders.instructions.put(at, instruction);
            exchange.put_orders(orders);
        };
        give(1, Instruction::Land);
        (2..10_000).for_each(|ms| give(ms, Instruction::GrantLeave));
        let orders = exchange.take_orders().unwrap();
        let left: Vec<_> = orders.instructions.into_iter().collect();
        let ms = Duration::from_millis;
        assert_eq!(left, [(ms(1), Instruction::Land), (ms(9999), Instruction::GrantLeave)]);
        assert_eq!(orders.decided, ms(9999));
    }
}
