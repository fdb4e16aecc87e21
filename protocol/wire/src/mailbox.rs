//! The messages that wait for a node, so kept that no sender's displace another's.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use skein_bp::Bound;
use skein_dbp::NodeName;

use crate::key::Key;

/// The sender of the messages; none for those whose sender has no queue of its own.
pub type Owner = Option<NodeName>;

/// Messages in the order of their arrival, with a bound on those of each sender and on all together. Where there is no
/// room, the oldest go of whoever has too many: newer ones say more.
#[derive(Debug)]
pub struct Mailbox {
    waiting: BTreeMap<u64, (Owner, Key, Vec<u8>)>,
    /// Of each that has any.
    queues: BTreeMap<Owner, Queue>,
    /// Those who have a queue of their own whatever others send.
    members: BTreeSet<NodeName>,
    bytes: usize,
    capacity: usize,
    next: u64,
    dropped: BTreeMap<Owner, u64>,
}

#[derive(Debug, Default)]
struct Queue {
    numbers: VecDeque<u64>,
    bytes: usize,
}

impl Mailbox {
    /// A mailbox for so many messages in all.
    pub fn new(capacity: usize) -> Self {
        Self {
            waiting: BTreeMap::new(),
            queues: BTreeMap::new(),
            members: BTreeSet::new(),
            bytes: 0,
            capacity,
            next: 0,
            dropped: BTreeMap::new(),
        }
    }

    /// Whom the messages are from, in all likelihood.
    pub fn meet(&mut self, members: impl IntoIterator<Item = NodeName>) {
        self.members.extend(members);
    }

    pub fn push(&mut self, key: Key, payload: Vec<u8>) {
        let owner = self.owner(key.sender());
        let queue = self.queues.entry(owner.clone()).or_default();
        queue.numbers.push_back(self.next);
        queue.bytes += payload.len();
        self.bytes += payload.len();
        self.waiting.insert(self.next, (owner.clone(), key, payload));
        self.next += 1;
        while self.queues.get(&owner).is_some_and(Queue::is_over) {
            self.drop_oldest(&owner);
        }
        while self.waiting.len() > self.capacity {
            self.drop_oldest_of(|queue| queue.numbers.len());
        }
        while self.bytes > Bound::WaitingInAll.most() {
            self.drop_oldest_of(|queue| queue.bytes);
        }
    }

    /// The same, in place of the message under the same key that waits, if one does.
    pub fn push_newest(&mut self, key: Key, payload: Vec<u8>) {
        let owner = self.owner(key.sender());
        let numbers = self.queues.get(&owner).map(|queue| queue.numbers.clone()).unwrap_or_default();
        let same =
            numbers.into_iter().find(|number| self.waiting.get(number).is_some_and(|(_, at, _)| *at == key));
        if let Some((number, (.., before))) =
            same.and_then(|number| Some((number, self.waiting.remove(&number)?)))
        {
            self.note_gone(&owner, number, before.len());
        }
        self.push(key, payload);
    }

    /// The oldest message.
    pub fn pop(&mut self) -> Option<(Key, Vec<u8>)> {
        let (number, (owner, key, payload)) = self.waiting.pop_first()?;
        self.note_gone(&owner, number, payload.len());
        Some((key, payload))
    }

    /// Takes out the messages that `may` come now, oldest first; it is asked with the key and the bytes. Of those that
    /// have to wait, the newest under a key stands for all before it, if it says all.
    pub fn take(&mut self, mut may: impl FnMut(&Key, usize) -> bool) -> Vec<(Key, Vec<u8>)> {
        let due = |(_, (_, key, payload)): &(&u64, &(Owner, Key, Vec<u8>))| may(key, payload.len());
        let due: Vec<u64> = self.waiting.iter().filter(due).map(|(number, _)| *number).collect();
        let mut taken = Vec::with_capacity(due.len());
        for number in due {
            if let Some((owner, key, payload)) = self.waiting.remove(&number) {
                self.note_gone(&owner, number, payload.len());
                taken.push((key, payload));
            }
        }
        self.drop_superseded();
        taken
    }

    fn drop_superseded(&mut self) {
        if self.waiting.is_empty() {
            return;
        }
        let mut newest: BTreeMap<&Key, (u64, &Owner)> = BTreeMap::new();
        let mut superseded = Vec::new();
        for (number, (owner, key, _)) in self.waiting.iter().filter(|(_, (_, key, _))| key.says_all()) {
            // The one before may lie in another queue: its sender had none of its own then.
            if let Some((before, its_owner)) = newest.insert(key, (*number, owner)) {
                superseded.push((before, its_owner.clone()));
            }
        }
        for (number, owner) in superseded {
            self.drop_one(&owner, number);
        }
    }

    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    pub fn len(&self) -> usize {
        self.waiting.len()
    }

    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// The senders of whom anything waits; those without a queue of their own count as one.
    pub fn senders(&self) -> usize {
        self.queues.len()
    }

    /// The messages that wait of one sender, and their bytes.
    pub fn waiting_of(&self, owner: &Owner) -> (usize, usize) {
        self.queues.get(owner).map_or((0, 0), |queue| (queue.numbers.len(), queue.bytes))
    }

    /// The messages that had to go, by sender.
    pub fn dropped(&self) -> &BTreeMap<Owner, u64> {
        &self.dropped
    }

    fn owner(&self, sender: &NodeName) -> Owner {
        let own = Some(sender.clone());
        let strangers = self.queues.len().saturating_sub(self.members.len());
        let has_own = self.members.contains(sender)
            || self.queues.contains_key(&own)
            || strangers < Bound::WaitingSenders.most();
        own.filter(|_| has_own)
    }

    fn drop_oldest_of(&mut self, most: impl Fn(&Queue) -> usize) {
        let fullest = self.queues.iter().max_by_key(|(_, queue)| most(queue)).map(|(owner, _)| owner.clone());
        if let Some(owner) = fullest {
            self.drop_oldest(&owner);
        }
    }

    fn drop_oldest(&mut self, owner: &Owner) {
        let Some(number) = self.queues.get(owner).and_then(|queue| queue.numbers.front().copied()) else {
            return;
        };
        self.drop_one(owner, number);
    }

    fn drop_one(&mut self, owner: &Owner, number: u64) {
        if let Some((_, _, payload)) = self.waiting.remove(&number) {
            self.note_gone(owner, number, payload.len());
        }
        // Names are free: what is counted of those outside the roster is counted together.
        let counted = owner.clone().filter(|name| self.members.contains(name));
        *self.dropped.entry(counted).or_default() += 1;
    }

    fn note_gone(&mut self, owner: &Owner, number: u64, bytes: usize) {
        self.bytes -= bytes;
        let Some(queue) = self.queues.get_mut(owner) else { return };
        queue.bytes -= bytes;
        if queue.numbers.front() == Some(&number) {
            queue.numbers.pop_front();
        } else if let Ok(at) = queue.numbers.binary_search(&number) {
            queue.numbers.remove(at);
        }
        if queue.numbers.is_empty() {
            self.queues.remove(owner);
        }
    }
}

impl Queue {
    fn is_over(&self) -> bool {
        self.numbers.len() > Bound::WaitingMessages.most() || self.bytes > Bound::WaitingBytes.most()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Fleet;
    use crate::message::State;

    fn key(sender: &str) -> Key {
        Key::to_all::<State>(&Fleet::new("demo").unwrap(), NodeName::new(sender).unwrap())
    }

    fn mailbox() -> Mailbox {
        let mut mailbox = Mailbox::new(100_000);
        mailbox.meet(["uav/1", "uav/2"].map(|name| NodeName::new(name).unwrap()));
        mailbox
    }

    fn left_of(mailbox: &mut Mailbox, sender: &str) -> Vec<u8> {
        let of_sender =
            |(key, payload): (Key, Vec<u8>)| (key.sender().as_str() == sender).then(|| payload[0]);
        std::iter::from_fn(|| mailbox.pop()).filter_map(of_sender).collect()
    }

    #[test]
    fn who_floods_loses_its_own_oldest_and_nobody_else_s() {
        let mut mailbox = mailbox();
        mailbox.push(key("uav/2"), vec![7]);
        for number in 0..10_000_u32 {
            mailbox.push(key("uav/1"), vec![number as u8]);
            mailbox.push(key(&format!("uav/x{number}")), vec![0]);
        }
        let (member, stranger) = (Some(NodeName::new("uav/1").unwrap()), None);
        assert_eq!(mailbox.dropped()[&member], 10_000 - Bound::WaitingMessages.stated() as u64);
        assert!(mailbox.dropped()[&stranger] > 9000 && mailbox.dropped().len() == 2);
        assert_eq!(left_of(&mut mailbox, "uav/2"), [7]);
        assert!(mailbox.is_empty() && mailbox.bytes() == 0 && mailbox.queues.is_empty());
    }

    #[test]
    fn the_newest_stays() {
        let mut mailbox = mailbox();
        (0..=255).cycle().take(1024).for_each(|byte| mailbox.push(key("uav/1"), vec![byte]));
        assert_eq!(left_of(&mut mailbox, "uav/1").last(), Some(&255));
    }

    #[test]
    fn long_messages_of_many_senders_fill_no_more_than_all_may() {
        let mut mailbox = mailbox();
        for sender in 0..100 {
            for _ in 0..100 {
                mailbox.push(key(&format!("uav/x{sender}")), vec![0; 10_000]);
                assert!(mailbox.bytes() <= Bound::WaitingInAll.stated());
            }
        }
        mailbox.push(key("uav/2"), vec![9]);
        mailbox.push(key("uav/x1"), vec![0; 10_000]);
        assert_eq!(left_of(&mut mailbox, "uav/2"), [9]);
    }

    #[test]
    fn a_message_that_came_while_its_sender_had_no_queue_goes_when_a_newer_one_comes() {
        let mut mailbox = mailbox();
        // The members' queues are empty.
        let most = Bound::WaitingSenders.stated() + 2;
        for sender in 0..=most {
            mailbox.push(key(&format!("uav/x{sender}")), vec![0; 100]);
        }
        let last = format!("uav/x{most}");
        let gone = mailbox.take(|key, _| key.sender().as_str() != last);
        assert_eq!((gone.len(), mailbox.waiting_of(&None)), (most, (1, 100)));
        mailbox.push(key(&last), vec![1; 10]);
        assert!(mailbox.take(|_, _| false).is_empty());
        assert_eq!((mailbox.len(), mailbox.bytes(), mailbox.waiting_of(&None)), (1, 10, (0, 0)));
        assert_eq!(left_of(&mut mailbox, &last), [1]);
    }

    #[test]
    fn what_may_not_come_yet_waits_in_its_order() {
        let mut mailbox = mailbox();
        for byte in 0..4 {
            mailbox.push(key("uav/1"), vec![byte]);
            mailbox.push(key("uav/2"), vec![byte]);
        }
        let mut left = 2;
        let taken = mailbox.take(|key, _| {
            let sender = key.sender().as_str();
            let may = sender == "uav/2" || left > 0;
            left -= i32::from(sender == "uav/1");
            may
        });
        assert_eq!(taken.len(), 6);
        assert_eq!(left_of(&mut mailbox, "uav/1"), [3], "the newest state says all");
    }
}
