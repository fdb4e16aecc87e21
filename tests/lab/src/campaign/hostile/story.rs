//! A hostile member's story as data: its habits, made from a seed, and shorter ones.

use std::fmt;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// It falls silent by then, in ticks of 20 ms.
pub const LAST_TICK: u64 = 600;

skein_bp::words! {
    /// By which right the hostile member is in the fleet.
    pub enum Rank {
        Vehicle = "vehicle",
        Operator = "operator",
        /// None: whoever is beside a fleet without certificates and without a roster speaks under ever new names.
        Crowd = "crowd",
    }
}

skein_bp::words! {
    /// A thing to say. What its size is stands beside.
    pub enum Say {
        /// Signs of life, each of a new life; lives at once.
        Lives = "lives",
        /// A sign of life with the greatest numbers there are; their binary digits.
        Absurd = "absurd",
        /// Signs of life that speak of occurrences which nobody has heard; how many.
        Ahead = "ahead",
        /// States at a place that jumps about; metres.
        Jumps = "jumps",
        /// States of a huge radius, position error and speed; m, m/s.
        Huge = "huge",
        /// States with long texts; bytes.
        Words = "words",
        /// States and records with times and numbers of long ago; how long, s.
        Stale = "stale",
        /// A block inside nested sets; levels.
        Deep = "deep",
        /// A block of many sets; how many.
        Wide = "wide",
        /// A new life that blocks something else than the one before, and for longer than it lasts; sets.
        Keeps = "keeps",
        /// A record of many b-threads' bids; how many.
        Many = "many",
        /// Bids for events that others decide on; how many.
        Asks = "asks",
        /// A bid for events that its own blocks keep from happening; how many.
        Waits = "waits",
        /// Records that contradict one another; how many.
        Contradicts = "contradicts",
        /// Names that are long; bytes.
        Names = "names",
        /// Names of many chunks; how many.
        Chunks = "chunks",
        /// Events with many data; how many.
        Fields = "fields",
        /// Acknowledgements that refuse what was asked, or never was; how many.
        Refuses = "refuses",
        /// Occurrences behind a hole; how many.
        Happens = "happens",
        /// Occurrences that are long; bytes.
        Long = "long",
        /// Occurrences that serve many requests; how many.
        Serves = "serves",
        /// Wishes for repair; occurrences.
        Wants = "wants",
        /// What another node would say, under the own key; messages.
        Forges = "forges",
        /// What others have said, again, under the own key; messages.
        Repeats = "repeats",
        /// A board of deep and wide sets; sets.
        Boards = "boards",
        /// Checks before take-off; how many.
        Checks = "checks",
        /// Messages of any kind with a field that nobody knows; its bytes.
        Padded = "padded",
        /// Many short messages; how many.
        Floods = "floods",
        /// What is no message; bytes.
        Garbage = "garbage",
        /// Scripts that have many or deep sets, or become long when they are filled in; sets, more or less.
        Loads = "loads",
        /// Scripts of ever new names that end at once; how many.
        Ends = "ends",
        /// Long occurrences and states of vehicles that nobody knows; vehicles.
        Invents = "invents",
    }
}

impl Say {
    /// The size up to which it is let through, more or less, and that of the worst.
    fn sizes(self) -> (u64, u64) {
        match self {
            Self::Lives => (3, 40),
            Self::Absurd => (63, 63),
            Self::Ahead => (2000, 1 << 40),
            Self::Jumps => (50, 1 << 24),
            Self::Huge => (40, 1 << 40),
            Self::Words => (500, 8000),
            Self::Stale => (100, 1 << 20),
            Self::Deep => (12, 40),
            Self::Wide => (700, 3500),
            Self::Keeps => (900, 1000),
            Self::Many => (500, 1200),
            Self::Asks => (100, 300),
            Self::Waits => (60, 128),
            Self::Contradicts => (8, 30),
            Self::Names => (250, 2000),
            Self::Chunks => (15, 60),
            Self::Fields => (30, 100),
            Self::Refuses => (800, 6000),
            Self::Happens => (60, 400),
            Self::Long => (30_000, 190_000),
            Self::Serves => (250, 600),
            Self::Wants => (1000, 1 << 40),
            Self::Forges | Self::Repeats => (10, 40),
            Self::Boards => (1000, 9000),
            Self::Checks => (60, 2000),
            Self::Padded => (15_000, 1_200_000),
            Self::Floods => (200, 1500),
            Self::Garbage => (100, 1_200_000),
            Self::Loads => (100, 390),
            Self::Ends => (8, 100),
            Self::Invents => (100, 200),
        }
    }
}

/// A thing said again and again for a while.
#[derive(Clone, Debug, PartialEq)]
pub struct Habit {
    pub say: Say,
    /// The greatest of its sizes.
    pub size: u64,
    /// Chance of what it says.
    pub seed: u64,
    /// The first tick.
    pub from: u64,
    /// The tick after the last.
    pub until: u64,
    /// Ticks from one to the next.
    pub every: u64,
}

impl Habit {
    pub fn is_due(&self, tick: u64) -> bool {
        (self.from..self.until).contains(&tick) && (tick - self.from).is_multiple_of(self.every)
    }
}

impl fmt::Display for Habit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { say, size, from, until, every, .. } = self;
        write!(f, "{} of {size}, ticks {from} to {until}, each {every}", say.word())
    }
}

/// A hostile member, and what it is about to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Story {
    pub seed: u64,
    pub rank: Rank,
    pub habits: Vec<Habit>,
}

impl Story {
    /// The story of a seed; every fourth is an operator's, every tenth a crowd's.
    #[must_use]
    pub fn of(seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let rank = match seed {
            seed if seed.is_multiple_of(4) => Rank::Operator,
            seed if seed % 10 == 5 => Rank::Crowd,
            _ => Rank::Vehicle,
        };
        let count = random.random_range(6..=14);
        let mut habits: Vec<Habit> = (0..count).map(|_| any_habit(&mut random)).collect();
        // What only this rank may.
        let own: &[Say] = match rank {
            Rank::Vehicle => &[],
            Rank::Operator => &[Say::Loads, Say::Ends, Say::Long],
            Rank::Crowd => &[Say::Invents],
        };
        // It does so all the time: what it brings about adds up.
        let always = |say: &Say| Habit { from: 20, until: LAST_TICK, every: 2, ..habit(*say, &mut random) };
        habits.extend(own.iter().map(always));
        Self { seed, rank, habits }
    }

    /// Stories that are shorter or smaller by one thing, the greatest simplifications first.
    fn simpler(&self) -> Vec<Self> {
        let all = 0..self.habits.len();
        let without = all.clone().map(|index| {
            let mut story = self.clone();
            story.habits.remove(index);
            story
        });
        let changed = |index: usize, change: &dyn Fn(&mut Habit)| {
            let mut story = self.clone();
            story.habits.iter_mut().skip(index).take(1).for_each(change);
            story
        };
        let shorter = all.clone().map(|index| {
            changed(index, &|habit| habit.until = habit.from + (habit.until - habit.from).div_ceil(2))
        });
        let smaller = all.map(|index| changed(index, &|habit| habit.size = habit.size.div_ceil(2)));
        without.chain(shorter).chain(smaller).filter(|story| story != self).collect()
    }

    /// Leaves out of a story whatever it fails without, in so many tries.
    pub fn shrink(
        mut self,
        mut tries: usize,
        fails: impl Fn(&Self) -> anyhow::Result<bool>,
    ) -> anyhow::Result<Self> {
        'found: loop {
            for story in self.simpler() {
                if tries == 0 {
                    return Ok(self);
                }
                tries -= 1;
                if fails(&story)? {
                    self = story;
                    continue 'found;
                }
            }
            return Ok(self);
        }
    }
}

impl fmt::Display for Story {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "seed {}, as {}:", self.seed, self.rank.word())?;
        self.habits.iter().try_for_each(|habit| write!(f, " {habit};"))
    }
}

fn any_habit(random: &mut ChaCha8Rng) -> Habit {
    let say = loop {
        let say = Say::ALL[random.random_range(0..Say::ALL.len())];
        // One that has led its last life says nothing more that counts.
        if say != Say::Absurd || random.random_bool(0.2) {
            break say;
        }
    };
    habit(say, random)
}

fn habit(say: Say, random: &mut ChaCha8Rng) -> Habit {
    let (common, worst) = say.sizes();
    let most = if random.random_bool(0.35) { worst } else { common };
    let size = (most as f64).powf(random.random_range(0.8_f64..=1.0)).round() as u64;
    let from = random.random_range(0..LAST_TICK / 2);
    let until = random.random_range(from + 1..=LAST_TICK);
    let every = if most == worst { random.random_range(2..=25) } else { random.random_range(1..=10) };
    Habit { say, size, seed: random.random(), from, until, every }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_story_shrinks_to_the_habit_that_matters() {
        let story = (1..).map(Story::of).find(|story| story.habits.len() > 5).unwrap();
        let needed = story.habits[3].seed;
        let fails = |story: &Story| Ok(story.habits.iter().any(|habit| habit.seed == needed));
        let shrunk = story.shrink(200, fails).unwrap();
        assert_eq!((shrunk.habits.len(), shrunk.habits[0].size), (1, 1));
        assert_eq!(shrunk.habits[0].until, shrunk.habits[0].from + 1);
    }
}
